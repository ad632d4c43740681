// Whether this browser has a headset; what draws for it is loaded when it is put on.

export const HEADSET_VIEWS = ['table', 'trackside', 'driver'] as const;
/** A model on a table, the track at true scale, or the seat of a kart. */
export type HeadsetView = (typeof HEADSET_VIEWS)[number];

export const HEADSET_MODES = ['immersive-ar', 'immersive-vr'] as const;
/** With the room around, or without. */
export type HeadsetMode = (typeof HEADSET_MODES)[number];

/** Returns the modes that a headset of this browser has; none without one. */
export async function headsetModes(): Promise<HeadsetMode[]> {
  const system = navigator.xr;
  if (!system) return [];
  const has = await Promise.all(
    HEADSET_MODES.map((mode) => system.isSessionSupported(mode).catch(() => false)),
  );
  return HEADSET_MODES.filter((_, index) => has[index]);
}
