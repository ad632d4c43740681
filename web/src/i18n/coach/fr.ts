import { type CoachWords, fine, whole } from './words';

export const fr: CoachWords = {
  cues: [
    '',
    'freine plus tard',
    'reste au gaz',
    'braque plus tôt',
    'garde de la vitesse',
    'plus près de la corde',
    'gaz plus tôt',
    'garde les gaz',
    'laisse filer',
    '',
  ],
  liftLater: 'lève le pied plus tard',
  tries: [
    () => '',
    ({ size, reach }) =>
      reach
        ? `freine ${whole(size)} m plus tard : la limite freine ${whole(reach)} m avant la corde`
        : `lève le pied ${whole(size)} m plus tard : ici, pas besoin de freiner`,
    ({ size, reach }) =>
      reach
        ? `reste au gaz ${whole(size)} m de plus, puis freine`
        : `reste au gaz ${whole(size)} m de plus : ici, pas besoin de freiner`,
    ({ size }) => `braque plus tôt : ${fine(size)} m trop à l’extérieur à l’entrée`,
    ({ size }) => `garde ${fine(size * 3.6)} km/h de plus dans le virage`,
    ({ size }) => `passe la corde ${fine(size)} m plus à l’intérieur`,
    ({ size }) => `remets les gaz ${whole(size)} m plus tôt, dès la corde`,
    ({ size }) => `garde les gaz en sortie : coupés pendant ${whole(size)} m`,
    ({ size }) => `laisse filer le kart : ${fine(size)} m de piste restent libres en sortie`,
    () => 'aucune faute de pilotage ; regarde le kart',
  ],
  lap: (lap, time) => `Tour ${lap} : ${time}`,
  behind: (seconds) => `${seconds} s sur la limite`,
  nothing: 'aucune faute',
  notCompared: (why) => `pas comparé : ${why}`,
  reasons: [
    [/^from the start$/, 'depuis le départ'],
    [/^not clean$/, 'pas propre'],
    [/^touched a kart$/, 'contact avec un kart'],
    [/^hit by an item$/, 'touché par un objet'],
    [/^([\d.]+) s under an item's effect$/, '$1 s sous l’effet d’un objet'],
    [/^([\d.]+) s under a flag$/, '$1 s sous drapeau'],
    [/^([\d.]+) s in traffic$/, '$1 s dans le trafic'],
  ],
};
