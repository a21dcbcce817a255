// The two pictures that points are picked on: the recording's as it is archived, and the plan's of the same moment, which can be turned.
import type { ComponentChildren } from 'preact';
import { useLayoutEffect, useRef } from 'preact/hooks';
import { useSignal } from '@preact/signals';
import { formatTime } from '@/base/time';
import type { MatchingModel } from '@/compare/matching_model';
import type { PickingModel, RecordedFrame } from '@/compare/picking_model';
import { type Place, placeOf, seenBy } from '@/compare/picks';
import { type MessageKey, t, word } from '@/i18n/i18n';
import { kFirstView, panned, turned, viewByKey, zoomedByWheel } from '@/planning/orbit';
import { type Box, moved, partAt, pictureBox } from '@/pointing/geometry';
import { announce } from '@/shell/state';

/** Further than that a hand turns the plan or moves a mark; nearer it picks or chooses. */
const kDragged_px = 4;
const kPixelsByKey = 1;
const kPixelsByShift = 10;
const kArrows: Record<string, readonly [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

interface Mark {
  key: string;
  text: string;
  label: string;
  place: Place;
  chosen: boolean;
  choose: () => void;
  move: (place: Place) => void;
  remove: () => void;
}

interface FieldProps {
  label: string;
  how: string;
  width: number;
  height: number;
  marks: readonly Mark[];
  pick: (place: Place) => void;
  /** A drag beside the marks; absent: there is none. Nothing moved: it ends. */
  drag?: ((by: { dx: number; dy: number; pan: boolean } | undefined) => void) | undefined;
  wheel?: ((delta: number) => void) | undefined;
  children: ComponentChildren;
}

/** A picture with marks on it: places are picked by a click, or by the arrow keys and Enter; marks are dragged, or moved by the arrow keys. */
function PickField({ label, how, width, height, marks, pick, drag, wheel, children }: FieldProps) {
  const field = useRef<HTMLDivElement>(null);
  const box = useSignal<Box>({ left: 0, top: 0, width: 0, height: 0 });
  const cursor = useSignal<Place | undefined>(undefined);
  const held = useSignal<{ key: string; place: Place } | undefined>(undefined);
  const grabbed = useRef<{ x: number; y: number; place: Place; far: boolean } | undefined>(undefined);
  const pressed = useRef<{ x: number; y: number; far: boolean } | undefined>(undefined);
  const turns = useRef(wheel);
  turns.current = wheel;
  useLayoutEffect(() => {
    const place = field.current as HTMLDivElement;
    const measure = () => {
      box.value = pictureBox(place.clientWidth, place.clientHeight, width, height);
    };
    const observer = new ResizeObserver(measure);
    observer.observe(place);
    measure();
    return () => observer.disconnect();
  }, [width, height]);
  useLayoutEffect(() => {
    const place = field.current as HTMLDivElement;
    // Preact's own listeners are passive, and the page would scroll.
    const rolled = (event: WheelEvent) => {
      if (!turns.current) return;
      event.preventDefault();
      turns.current(event.deltaY);
    };
    place.addEventListener('wheel', rolled, { passive: false });
    return () => place.removeEventListener('wheel', rolled);
  }, []);
  const placed = (event: PointerEvent): Place | undefined => {
    const area = (field.current as HTMLElement).getBoundingClientRect();
    return partAt(event.clientX - area.left, event.clientY - area.top, box.value);
  };
  const onScreen = ({ x, y }: Place) => ({ left: `${box.value.left + x * box.value.width}px`, top: `${box.value.top + y * box.value.height}px` });
  const byKey = (event: KeyboardEvent): readonly [number, number] | undefined => {
    const along = kArrows[event.key];
    if (!along || event.ctrlKey || event.altKey || event.metaKey) return undefined;
    const by = event.shiftKey ? kPixelsByShift : kPixelsByKey;
    return [(along[0] * by) / width, (along[1] * by) / height];
  };
  return (
    <div
      ref={field}
      class="pick-field"
      role="application"
      tabIndex={0}
      aria-label={label}
      title={how}
      onPointerDown={(event) => {
        if (event.button !== 0) return;
        field.current?.focus();
        field.current?.setPointerCapture(event.pointerId);
        pressed.current = { x: event.clientX, y: event.clientY, far: false };
        cursor.value = undefined;
      }}
      onPointerMove={(event) => {
        const from = pressed.current;
        if (!from) return;
        const [dx, dy] = [event.clientX - from.x, event.clientY - from.y];
        if (!from.far && Math.hypot(dx, dy) < kDragged_px) return;
        pressed.current = { x: event.clientX, y: event.clientY, far: true };
        drag?.({ dx: dx / box.value.width, dy: dy / box.value.height, pan: event.shiftKey });
      }}
      onPointerUp={(event) => {
        const from = pressed.current;
        pressed.current = undefined;
        const place = placed(event);
        if (from?.far) drag?.(undefined);
        else if (from && place) pick(place);
      }}
      onPointerCancel={() => {
        pressed.current = undefined;
        drag?.(undefined);
      }}
      onKeyDown={(event) => {
        if (event.target !== event.currentTarget) return;
        const by = byKey(event);
        if (by) cursor.value = cursor.value ? moved(cursor.value, by[0], by[1]) : { x: 0.5, y: 0.5 };
        else if (event.key === 'Enter' && cursor.value) pick(cursor.value);
        else return;
        event.preventDefault();
        event.stopPropagation();
      }}
      onBlur={(event) => {
        if (event.target === event.currentTarget) cursor.value = undefined;
      }}
    >
      {children}
      {marks.map((mark) => (
        <button
          key={mark.key}
          type="button"
          class={mark.chosen ? 'pick-mark pick-mark-chosen' : 'pick-mark'}
          style={onScreen(held.value?.key === mark.key ? held.value.place : mark.place)}
          aria-label={mark.label}
          aria-pressed={mark.chosen}
          onClick={() => mark.choose()}
          onPointerDown={(event) => {
            if (event.button !== 0) return;
            event.stopPropagation();
            mark.choose();
            (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
            pressed.current = undefined;
            grabbed.current = { x: event.clientX, y: event.clientY, place: mark.place, far: false };
            held.value = { key: mark.key, place: mark.place };
          }}
          onPointerMove={(event) => {
            const from = grabbed.current;
            if (!from || held.value?.key !== mark.key) return;
            event.stopPropagation();
            const [dx, dy] = [event.clientX - from.x, event.clientY - from.y];
            // A mark that is clicked on is chosen, and stays to the pixel where it was.
            if (!from.far && Math.hypot(dx, dy) < kDragged_px) return;
            from.far = true;
            held.value = { key: mark.key, place: moved(from.place, dx / box.value.width, dy / box.value.height) };
          }}
          onPointerUp={(event) => {
            event.stopPropagation();
            const place = grabbed.current?.far ? held.value?.place : undefined;
            grabbed.current = undefined;
            held.value = undefined;
            if (place) mark.move(place);
          }}
          onPointerCancel={() => {
            grabbed.current = undefined;
            held.value = undefined;
          }}
          onKeyDown={(event) => {
            const by = byKey(event);
            if (by) mark.move(moved(mark.place, by[0], by[1]));
            else if (event.key === 'Delete') mark.remove();
            else return;
            event.preventDefault();
            event.stopPropagation();
          }}
        >
          <span aria-hidden="true">{mark.text}</span>
        </button>
      ))}
      {cursor.value && <span class="pick-cursor" style={onScreen(cursor.value)} aria-hidden="true" />}
    </div>
  );
}

function Frame({ frame }: { frame: RecordedFrame }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useLayoutEffect(() => {
    const one = canvas.current as HTMLCanvasElement;
    one.width = frame.width;
    one.height = frame.height;
    one.getContext('2d')?.drawImage(frame.picture, 0, 0);
  }, [frame]);
  return <canvas class="pane-original" ref={canvas} aria-hidden="true" />;
}

interface Props {
  picking: PickingModel;
  matching: MatchingModel;
  begins_ns: number;
}

function RecordedField({ picking, matching, begins_ns }: Props) {
  const frame = picking.frame.value;
  const picks = matching.picks.value;
  const tool = picking.tool.value;
  const ofTools = picking.work.value === 'tools';
  const name = word('stream', matching.plan.value?.stream ?? '');
  if (!frame) return <p class="pick-waits">{t('pick.frameWaits')}</p>;
  const marks: Mark[] = ofTools
    ? (picks.clicks.get(tool) ?? []).flatMap(({ at_ns, pixel }, at) =>
        at_ns === frame.time_ns
          ? [
              {
                key: tool,
                text: String(at + 1),
                label: t('pick.tipMark', { tool, n: at + 1 }),
                place: placeOf(pixel, frame),
                chosen: true,
                choose: () => {},
                move: (place: Place) => picking.pickPixel(place),
                remove: () => picking.removeClick(tool, at_ns),
              },
            ]
          : [],
      )
    : picks.pairs.flatMap(({ pixel }, pair) =>
        pixel
          ? [
              {
                key: String(pair),
                text: String(pair + 1),
                label: t('pick.pixelMark', { n: pair + 1 }),
                place: placeOf(pixel, frame),
                chosen: picking.chosenPair.value === pair,
                choose: () => (picking.chosenPair.value = pair),
                move: (place: Place) => picking.movePixel(pair, place),
                remove: () => picking.removePair(pair),
              },
            ]
          : [],
      );
  const pick = (place: Place) => {
    if (!picking.pickPixel(place)) return announce(t(picking.moment.peek() ? 'pick.frameWaits' : 'pick.needsStep'));
    announce(
      ofTools
        ? t('pick.tipPicked', { tool, time: formatTime(frame.time_ns - begins_ns, 3) })
        : t('pick.pixelPicked', { n: (picking.chosenPair.peek() ?? 0) + 1 }),
    );
  };
  return (
    <section class="pane pick-pane" aria-label={name}>
      <PickField
        label={ofTools ? t('pick.toolField', { name, tool }) : t('pick.frameField', { name })}
        how={t('pick.how')}
        width={frame.width}
        height={frame.height}
        marks={marks}
        pick={pick}
      >
        <Frame frame={frame} />
      </PickField>
      <header class="pane-head">
        <h2>{name}</h2>
        <span class="copy-label copy-label-original">{t('pane.original', { time: formatTime(frame.time_ns - begins_ns, 3) })}</span>
      </header>
    </section>
  );
}

const kTurnKeys: readonly { key: string; label: MessageKey; sign: string }[] = [
  { key: 'ArrowLeft', label: 'pick.turnLeft', sign: '←' },
  { key: 'ArrowRight', label: 'pick.turnRight', sign: '→' },
  { key: 'ArrowUp', label: 'pick.turnUp', sign: '↑' },
  { key: 'ArrowDown', label: 'pick.turnDown', sign: '↓' },
  { key: '+', label: 'pick.closer', sign: '+' },
  { key: '-', label: 'pick.further', sign: '−' },
];

function PlanField({ picking, matching }: Props) {
  const shown = picking.planPicture.value;
  const preparing = picking.preparing.value;
  const problem = picking.planProblem.value;
  const moment = picking.moment.value;
  const failed = problem !== undefined && (
    <p class="pick-failed" role="alert">
      {t('pick.failed', { problem })}{' '}
      <button type="button" class="button" onClick={() => picking.retry()}>
        {t('pick.retry')}
      </button>
    </p>
  );
  if (!moment) return <p class="pick-waits">{t('pick.needsStep')}</p>;
  if (!shown && failed) return <div class="pick-waits">{failed}</div>;
  if (!shown) {
    return (
      <div class="pick-waits" role="status">
        <p>{t('pick.preparing')}</p>
        <progress {...(preparing?.share ? { value: preparing.share } : {})} max="1" aria-label={t('pick.preparing')} />
      </div>
    );
  }
  const marks: Mark[] = matching.picks.value.pairs.flatMap(({ organ }, pair) => {
    const place = organ ? seenBy(shown.camera, organ) : undefined;
    if (!place || place.x < 0 || place.x > 1 || place.y < 0 || place.y > 1) return [];
    return [
      {
        key: String(pair),
        text: String(pair + 1),
        label: t('pick.organMark', { n: pair + 1 }),
        place,
        chosen: picking.chosenPair.value === pair,
        choose: () => (picking.chosenPair.value = pair),
        move: (to: Place) => void picking.moveOrgan(pair, to).then((on) => on || announce(t('pick.beside'))),
        remove: () => picking.removePair(pair),
      },
    ];
  });
  const pick = async (place: Place) =>
    announce((await picking.pickOrgan(place)) ? t('pick.organPicked', { n: (picking.chosenPair.peek() ?? 0) + 1 }) : t('pick.beside'));
  const step = matching.plan.value?.steps.find((one) => one.step === moment.step);
  return (
    <section class="pane pane-plan pick-pane" aria-label={t('plan.pictures')}>
      <PickField
        label={t('pick.organField')}
        how={t('pick.howPlan')}
        width={shown.view.width}
        height={shown.view.height}
        marks={marks}
        pick={(place) => void pick(place)}
        drag={(by) => {
          if (by) picking.turn((by.pan ? panned : turned)(picking.view.peek(), by.dx, by.dy), true);
          else picking.letGo();
        }}
        wheel={(delta) => picking.turn(zoomedByWheel(picking.view.peek(), delta), false)}
      >
        <img class="pane-original" src={shown.address} alt="" draggable={false} />
      </PickField>
      <header class="pane-head">
        <h2>{t('plan.pictures')}</h2>
        <span class="pane-step">{`${moment.step}. ${step?.name ?? ''}`}</span>
        <div class="pick-turns" role="group" aria-label={t('pick.turn')}>
          {kTurnKeys.map(({ key, label, sign }) => (
            <button
              key={key}
              type="button"
              class="button button-square"
              aria-label={t(label)}
              title={t(label)}
              onClick={() => {
                const view = viewByKey(picking.view.peek(), key, false);
                if (view) picking.turn(view, false);
              }}
            >
              {sign}
            </button>
          ))}
          <button type="button" class="button" onClick={() => picking.turn(kFirstView, false)}>
            {t('planning.front')}
          </button>
        </div>
        {failed}
      </header>
    </section>
  );
}

export function PickingStage(props: Props) {
  const ofTools = props.picking.work.value === 'tools';
  return (
    <div class={ofTools ? 'panes pick-stage' : 'panes pick-stage pick-stage-two'} inert={props.matching.making.value !== undefined}>
      <RecordedField {...props} />
      {!ofTools && <PlanField {...props} />}
    </div>
  );
}
