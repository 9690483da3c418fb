"""Segment-based maps from laser scans, without pose information."""
