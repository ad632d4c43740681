// What the page uses of the code that flatc generates: enumerations, readers and writers.
export {
  Advice,
  Button,
  Cause,
  DangerStage,
  Ending,
  EventKind,
  EventPhase,
  Fault,
  Flag,
  HintKind,
  KartFlag,
  Merit,
  Phase,
  RayHit,
  Retirement,
  Status,
} from './generated/codes.js';
export { AlertMessage } from './generated/drive/alert-message.js';
export { Control } from './generated/drive/control.js';
export { ControlMessage } from './generated/drive/control-message.js';
export { Hud } from './generated/drive/hud.js';
export { PoseMessage } from './generated/drive/pose-message.js';
export { Briefing } from './generated/session/briefing.js';
export { Course } from './generated/session/course.js';
export { Line } from './generated/session/line.js';
export { Rules } from './generated/session/rules.js';
export { Alerts } from './generated/spectate/alerts.js';
export { Events } from './generated/spectate/events.js';
export { Ghosts } from './generated/spectate/ghosts.js';
export { Lot } from './generated/spectate/lot.js';
export { Links } from './generated/spectate/links.js';
export { Programme } from './generated/spectate/programme.js';
export { Rays } from './generated/spectate/rays.js';
export { Snapshot } from './generated/spectate/snapshot.js';
export { Standings } from './generated/spectate/standings.js';
