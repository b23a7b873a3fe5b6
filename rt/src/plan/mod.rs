//! Trajectories: from any state to any state in minimum time within limits, for any number of axes at once.
