import { type CoachWords, fine, whole } from './words';

export const en: CoachWords = {
  cues: [
    '',
    'brake later',
    'stay on it',
    'turn in earlier',
    'carry speed',
    'closer to the apex',
    'throttle sooner',
    'keep it open',
    'let it run out',
    '',
  ],
  liftLater: 'lift later',
  tries: [
    () => '',
    ({ size, reach }) =>
      reach
        ? `brake ${whole(size)} m later: the limit brakes ${whole(reach)} m before the apex`
        : `lift ${whole(size)} m later: no brakes are needed here`,
    ({ size, reach }) =>
      reach
        ? `stay on the throttle ${whole(size)} m longer, then brake`
        : `stay on the throttle ${whole(size)} m longer: no brakes are needed here`,
    ({ size }) => `turn in earlier: you are ${fine(size)} m too far outside at the entry`,
    ({ size }) => `carry ${fine(size * 3.6)} km/h more through the bend`,
    ({ size }) => `pass the apex ${fine(size)} m nearer to the inside`,
    ({ size }) => `open the throttle ${whole(size)} m sooner, from the apex on`,
    ({ size }) => `keep the throttle open on the way out: it was closed for ${whole(size)} m`,
    ({ size }) => `let the kart run out: ${fine(size)} m of road are unused at the exit`,
    () => 'no fault of driving is seen; look at the kart',
  ],
  lap: (lap, time) => `Lap ${lap}: ${time}`,
  behind: (seconds) => `${seconds} s to the limit`,
  nothing: 'no fault is seen',
  notCompared: (why) => `not compared: ${why}`,
  reasons: [],
};
