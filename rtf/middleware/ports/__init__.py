"""Ports: connections in both directions, queues, requests and replies, administration, quality of service."""
