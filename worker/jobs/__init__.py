"""What a worker does for a task, one module a kind: ``run(tools, claim)`` does it and writes how it went.

A result is written in one transaction that the claim fences; what stands in the way is raised.
"""
