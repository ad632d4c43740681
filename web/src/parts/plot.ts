// uPlot in the page's colours and size.

import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';

export interface PlotLine {
  label: string;
  values: (number | null)[];
  colour: string;
  width?: number;
  dash?: number[];
  scale?: string;
  steps?: boolean;
}

export interface PlotSpec {
  x: number[];
  xLabel: string;
  lines: PlotLine[];
  yLabel: string;
  /** Upside down, first place on top. */
  isPlaces?: boolean;
  secondLabel?: string;
}

/** Keeps a plot in an element: created again when its lines change, otherwise only updated. */
export class Plot {
  private plot: uPlot | null = null;
  private kind = '';

  constructor(private readonly target: HTMLElement) {}

  show(spec: PlotSpec): void {
    const data = [spec.x, ...spec.lines.map((line) => line.values)] as uPlot.AlignedData;
    const { clientWidth: width, clientHeight: height } = this.target;
    const kind = `${width} ${height} ${spec.xLabel} ${spec.lines.map((line) => line.label).join()}`;
    if (this.plot && kind === this.kind) {
      this.plot.setData(data);
      return;
    }
    this.close();
    if (width < 40 || height < 40) return;
    this.kind = kind;
    this.plot = new uPlot(optionsOf(spec, width, height, this.target), data, this.target);
  }

  close(): void {
    this.plot?.destroy();
    this.plot = null;
  }
}

const LEGEND_PIXELS = 26;

function optionsOf(
  spec: PlotSpec,
  width: number,
  height: number,
  target: HTMLElement,
): uPlot.Options {
  const look = getComputedStyle(target);
  const [ink, rule] = [look.getPropertyValue('--faint'), look.getPropertyValue('--rule')];
  const axis = { stroke: ink, grid: { stroke: rule, width: 1 }, ticks: { stroke: rule } };
  const hasSecond = spec.lines.some((line) => line.scale === 'second');
  return {
    width,
    height: height - LEGEND_PIXELS,
    padding: [10, 8, 0, 0],
    cursor: { y: false, points: { size: 6 } },
    legend: { live: false },
    scales: {
      x: { time: false },
      y: spec.isPlaces ? { dir: -1, range: (_, __, most) => [0.5, Math.max(most, 2) + 0.5] } : {},
    },
    axes: [
      { ...axis, label: spec.xLabel, labelSize: 18, size: 34, ...wholeSteps(spec) },
      { ...axis, label: spec.yLabel, labelSize: 18, size: 44, ...wholeSteps(spec) },
      ...(hasSecond
        ? [
            {
              ...axis,
              scale: 'second',
              side: 1,
              label: spec.secondLabel ?? '',
              labelSize: 18,
              size: 44,
              grid: { show: false },
            },
          ]
        : []),
    ],
    series: [
      { label: spec.xLabel },
      ...spec.lines.map((line) => ({
        label: line.label,
        stroke: line.colour,
        width: line.width ?? 2,
        dash: line.dash ?? [],
        scale: line.scale ?? 'y',
        points: { show: Boolean(line.steps), size: 7, fill: line.colour },
      })),
    ],
  };
}

function wholeSteps(spec: PlotSpec): Partial<uPlot.Axis> {
  return spec.isPlaces ? { incrs: [1, 2, 5, 10, 20] } : {};
}
