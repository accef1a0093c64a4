"""Gaze control: requests, server, client, and the controller as a device."""
