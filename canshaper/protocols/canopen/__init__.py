"""CANopen: heartbeat and emergency of nodes, valves of CiA 408."""
