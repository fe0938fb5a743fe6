//! Bags: recordings in and out of MCAP files as rosbag2 writes them.
