"""Drivers: devices that are hardware or fakes of it, and devices that combine others."""
