// The task itself: the picture, the fingers on it, and what a trainee may know.
import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { Median } from '@/base/median';
import { t } from '@/i18n/i18n';
import { Icon } from '@/shell/icon';
import { announce } from '@/shell/state';
import { StressScale } from '@/shell/stress_scale';
import { placeOn, useField } from '@/shell/use_field';
import { AttemptFacts, Forces, PointMark, PressScale } from '@/training/attempt_parts';
import { type BrowserPointer, Pointers } from '@/training/pointers';
import { Tone } from '@/training/tone';
import { AttemptConnection, type Began, type Begin, type Moment, type Over } from '@/training/training_api';
import { useGamepad } from '@/training/use_gamepad';

const kMuted = 'kiroku.training.muted';
/** Numbers are written so often; pictures are drawn each. */
const kEvery_ms = 100;

export function AttemptView({ begin, over, lost }: { begin: Begin; over: (began: Began, over: Over) => void; lost: (sentence: string) => void }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const field = useRef<HTMLDivElement>(null);
  const began = useSignal<Began | undefined>(undefined);
  const moment = useSignal<Moment | undefined>(undefined);
  const toPicture_ms = useSignal<number | undefined>(undefined);
  const muted = useSignal(localStorage.getItem(kMuted) === 'yes');
  const keys = useSignal<{ x: number; y: number; finger: number } | undefined>(undefined);
  const connection = useRef<AttemptConnection | undefined>(undefined);
  const pointers = useMemo(() => new Pointers(begin.fingers), [begin]);
  const tone = useMemo(() => new Tone(), [begin]);
  const sent = useMemo(() => new Map<number, number>(), [begin]);

  useEffect(() => {
    let told: Began | undefined;
    let seen = false;
    let written_ms = 0;
    const latency = new Median();
    tone.muted = muted.value;
    tone.start();
    connection.current = new AttemptConnection(begin, {
      began: (what) => {
        told = what;
        began.value = what;
        announce(t('attempt.began'));
        field.current?.focus();
      },
      moment: (now, picture) => {
        const context = canvas.current?.getContext('2d');
        if (!context) return;
        if (context.canvas.width !== picture.width) {
          context.canvas.width = picture.width;
          context.canvas.height = picture.height;
        }
        context.drawImage(picture, 0, 0);
        const at_ms = sent.get(now.input);
        if (at_ms !== undefined) {
          latency.add(performance.now() - at_ms);
          for (const number of sent.keys()) if (number <= now.input) sent.delete(number);
        }
        tone.play(now.tone_hz ?? 0);
        const inSight = told !== undefined && now.visible_share >= told.visible_share;
        if (inSight && !seen) announce(t('attempt.lineSeen'));
        seen = inSight;
        if (performance.now() - written_ms < kEvery_ms && moment.value) return;
        written_ms = performance.now();
        toPicture_ms.value = latency.value;
        moment.value = now;
      },
      over: (what) => {
        announce(t(`ending.${what.ending}`));
        if (told) over(told, what);
      },
      lost,
    });
    return () => {
      connection.current?.leave();
      tone.stop();
    };
  }, [begin]);

  const send = (at_ms: number) => {
    const number = connection.current?.point(pointers.pointers) ?? 0;
    if (number > 0) sent.set(number, at_ms);
  };
  const placed = (event: PointerEvent): BrowserPointer => ({
    id: event.pointerId,
    kind: event.pointerType === 'touch' || event.pointerType === 'pen' ? event.pointerType : 'mouse',
    ...placeOn(field.current as HTMLDivElement, event),
    pressure: event.pressure,
  });
  const press = (event: PointerEvent) => {
    if (event.button !== 0 || !pointers.press(placed(event))) return;
    field.current?.setPointerCapture(event.pointerId);
    send(event.timeStamp);
  };
  const release = (event: PointerEvent) => {
    if (pointers.release(event.pointerId)) send(event.timeStamp);
  };
  const showKeys = () => {
    const { x, y, finger } = pointers.keysAt;
    keys.value = { x, y, finger };
  };
  useField(
    field,
    {
      wheel: (event) => {
        if (pointers.wheel(event.deltaY)) send(event.timeStamp);
      },
      hidden: () => {
        pointers.releaseAll();
        send(performance.now());
      },
    },
    begin,
  );
  const padMarks = useGamepad(pointers, begin.fingers, () => send(performance.now()));

  const told = began.value;
  const now = moment.value;
  return (
    <main id="main" class="main pad attempt" tabIndex={-1}>
      <div class="view-head">
        <h1>{told ? t(told.test ? 'attempt.test' : 'attempt.practice', { session: told.session }) : t('train.title')}</h1>
        <div class="attempt-do">
          <button
            type="button"
            class="button button-quiet"
            onClick={() => {
              muted.value = !muted.value;
              tone.muted = muted.value;
              localStorage.setItem(kMuted, muted.value ? 'yes' : 'no');
            }}
          >
            <Icon name={muted.value ? 'soundOff' : 'sound'} />
            {muted.value ? t('attempt.unmute') : t('attempt.mute')}
          </button>
          <button type="button" class="button" onClick={() => (told ? connection.current?.giveUp() : lost(''))}>
            {t('attempt.giveUp')}
          </button>
        </div>
      </div>
      <div class="attempt-body">
        <div class="attempt-picture">
          <div
            ref={field}
            class="attempt-field"
            role="application"
            tabIndex={0}
            aria-label={t('attempt.picture')}
            aria-busy={told === undefined}
            onPointerDown={press}
            onPointerMove={(event) => {
              if (pointers.move(placed(event))) send(event.timeStamp);
            }}
            onPointerUp={release}
            onPointerCancel={release}
            onContextMenu={(event) => event.preventDefault()}
            onKeyDown={(event) => {
              if (event.ctrlKey || event.altKey || event.metaKey || !pointers.key(event.key, event.shiftKey)) return;
              event.preventDefault();
              showKeys();
              send(event.timeStamp);
            }}
            onBlur={() => {
              keys.value = undefined;
            }}
          >
            <canvas ref={canvas} width={640} height={480} aria-hidden="true" />
            {!told && <p class="attempt-making">{t('attempt.making')}</p>}
            {padMarks.value.map((mark, i) => (
              <PointMark key={i} at={mark} down={mark.down} pad />
            ))}
            {keys.value && <PointMark at={keys.value} down={pointers.keysAreDown} />}
          </div>
          {told?.stress_shown && <StressScale most={told.damage_pa / 1000} label={t('attempt.scale', { most: told.damage_pa / 1000 })} />}
          <p class="muted attempt-how">
            {begin.instrument && `${t('attempt.howInstrument')} `}
            {t('attempt.how')} {t('attempt.howTouch')} {t('attempt.howKeys', { n: begin.fingers })} {t('attempt.howPad')}
          </p>
        </div>
        <div class="attempt-side">
          <AttemptFacts told={told} now={now} />
          <div class="card">
            <Forces
              forces_n={now?.forces_n ?? Array.from({ length: begin.fingers }, () => 0)}
              walls_n={begin.instrument && (now?.walls_n ?? [])}
              wrist_n={now?.wrist_force_n ?? 0}
            />
            {told?.press_n && <PressScale least_n={told.press_n[0]} most_n={told.press_n[1]} />}
          </div>
          <p class="muted attempt-latency">
            {now &&
              toPicture_ms.value !== undefined &&
              t('attempt.latency', { force: now.input_to_force_ms.toFixed(1), picture: toPicture_ms.value.toFixed(0) })}
          </p>
        </div>
      </div>
    </main>
  );
}
