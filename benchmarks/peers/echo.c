/* The floor: a joystick frame comes back as a valve frame, unread.  echo CHANNEL */
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

static int fail(const char *what)
{
    perror(what);
    return 1;
}

int main(int argc, char **argv)
{
    struct can_filter filter = {.can_id = 0x110, .can_mask = CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_SFF_MASK};
    struct sockaddr_can address = {.can_family = AF_CAN};
    struct can_frame frame;
    int port;

    if (argc != 2) {
        fprintf(stderr, "usage: echo CHANNEL\n");
        return 2;
    }
    port = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    if (port < 0)
        return fail("socket");
    if (setsockopt(port, SOL_CAN_RAW, CAN_RAW_FILTER, &filter, sizeof filter))
        return fail("filter");
    address.can_ifindex = if_nametoindex(argv[1]);
    if (bind(port, (struct sockaddr *)&address, sizeof address))
        return fail("bind");
    if (mlockall(MCL_CURRENT | MCL_FUTURE))
        perror("mlockall");
    puts("ready");
    fflush(stdout);
    for (;;) {
        if (read(port, &frame, sizeof frame) != sizeof frame)
            return fail("read");
        frame.can_id = 0x200;
        if (write(port, &frame, sizeof frame) != sizeof frame)
            return fail("write");
    }
}
