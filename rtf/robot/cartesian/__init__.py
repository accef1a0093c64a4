"""Cartesian control through the network: requests, server and client."""
