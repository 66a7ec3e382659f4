"""The console ``aerodb web``: HTML pages, and a JSON API with the documents of the commands.

`server` listens and serves the application of `app`; `security` decides who may read and who may
change. `console` has what every page needs; `models` describes the API's answers.

Pages: `overview_page`, `flight_pages`, `version_pages`, `lineage_pages`, `finding_pages`,
`work_pages`, `change_pages`. Their content comes from `aerodb.tasks.view`; nothing is loaded from
another host.
"""
