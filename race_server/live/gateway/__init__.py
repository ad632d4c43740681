"""The gateway: lets browsers watch, drive and steward a race, from a separate process.

- `service`: the process; `settings`: what is fixed at its start; `limits`: bounds and timeouts;
  `state`: what all browser sessions share.
- `app`: HTTP routes; `page`: files; `connection`: all that depends on uvicorn's internals.
- `browser`: one browser's session; `handshake`: its text messages; `roles`, `origins`, `key_ring`:
  who may connect and with which keys.
- `listener`, `live`: the race, received once; `audience`, `frames`: what is sent to browsers.
- `driver_seat`: a seat driven from a browser; `stewarding`: decisions of a steward.
- `library`, `playback`: recordings; `rays`: sensor rays computed from snapshots.
"""
