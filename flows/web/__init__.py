"""The console ``aerodb web``: pages for people and a JSON API beside each, both from the documents
that commands answer.

A module per group of pages; what is true stands in `tasks` and below. Nothing here is loaded from
another host.
"""
