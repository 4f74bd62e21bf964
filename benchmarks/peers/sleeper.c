/* A loop that only sleeps until its next deadline; writes each deadline and how late it was, ns.
   sleeper PERIOD_NS COUNT */
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

static long long ns(struct timespec t)
{
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

int main(int argc, char **argv)
{
    struct timespec now, next;
    long long period, begin, deadline, *late;
    int count;

    if (argc != 3) {
        fprintf(stderr, "usage: sleeper PERIOD_NS COUNT\n");
        return 2;
    }
    period = atoll(argv[1]);
    count = atoi(argv[2]);
    late = calloc(count, sizeof *late);
    if (!late || mlockall(MCL_CURRENT | MCL_FUTURE))
        perror("memory");
    clock_gettime(CLOCK_MONOTONIC, &now);
    begin = deadline = ns(now);
    for (int i = 0; i < count; i++) {
        deadline += period;
        next.tv_sec = deadline / 1000000000;
        next.tv_nsec = deadline % 1000000000;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
        clock_gettime(CLOCK_MONOTONIC, &now);
        late[i] = ns(now) - deadline;
    }
    for (int i = 0; i < count; i++)
        printf("%lld %lld\n", begin + (i + 1) * period, late[i]);
    return 0;
}
