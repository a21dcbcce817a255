// A plan that is made by hand: the picture, the tools on it, and what they came to.
import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { askBeforeLeaving } from '@/base/route';
import { t } from '@/i18n/i18n';
import { toldInOwnWords } from '@/i18n/server_words';
import { CutMarks, handleOf } from '@/planning/cut_marks';
import type { Opened, PlanMoment, Steps } from '@/planning/planning_api';
import { StressCard } from '@/planning/stress_card';
import { kKeyOfTool, kTools, type OnPicture, TableController, type Tool } from '@/planning/table_controller';
import { kHold_s, Palette } from '@/planning/table_palette';
import { ForceList, SaveDialog, StepList } from '@/planning/table_parts';
import { Icon } from '@/shell/icon';
import { announce, notify } from '@/shell/state';
import { StressScale } from '@/shell/stress_scale';
import { placeOn, useField } from '@/shell/use_field';

const kWidth = 800;
const kHeight = 600;
/** Numbers are written so often; pictures are drawn each. */
const kEvery_ms = 100;
/** From then on the page says that something is being computed. */
const kSlow_ms = 500;

/** "plan" of "liver/plan.json". */
const stemOf = (plan: string) => (plan.split('/').pop() ?? plan).replace(/\.json$/, '');

/** Whether the key is for the element itself. A slider and a box to tick leave undo and save to the page. */
function hasKeysOfItsOwn(target: HTMLElement, { ctrlKey, metaKey }: KeyboardEvent): boolean {
  const isPlain = !ctrlKey && !metaKey;
  if (target instanceof HTMLSelectElement) return isPlain;
  if (target instanceof HTMLInputElement) return isPlain || !['range', 'checkbox', 'radio'].includes(target.type);
  return target instanceof HTMLTextAreaElement;
}

export function TableView({ open, leave }: { open: { plan: string; anew: boolean }; leave: (sentence?: string) => void }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const field = useRef<HTMLDivElement>(null);
  const opening = useSignal('');
  const opened = useSignal<Opened | undefined>(undefined);
  const steps = useSignal<Steps>({ steps: [], undo: false, redo: false });
  const moment = useSignal<PlanMoment | undefined>(undefined);
  const rate = useSignal({ latency_ms: undefined as number | undefined, perSecond: 0 });
  const slow = useSignal(false);
  const saving = useSignal(false);
  /** As the plan was opened, or saved last. */
  const kept = useRef<Steps | undefined>(undefined);

  const table = useMemo(() => {
    let written_ms = 0;
    let late: ReturnType<typeof setTimeout> | undefined;
    const made: TableController = new TableController(open, {
      opening: (step) => (opening.value = step),
      opened: (what) => {
        opened.value = what;
        for (const warning of what.warnings) notify(warning);
        announce(t('planning.opened', { name: what.name || what.plan }));
        field.current?.focus();
      },
      steps: (what) => {
        kept.current ??= what;
        steps.value = what;
      },
      moment: (now, picture) => {
        canvas.current?.getContext('2d')?.drawImage(picture, 0, 0, kWidth, kHeight);
        const write = () => {
          written_ms = performance.now();
          moment.value = now;
          rate.value = { latency_ms: made.latency_ms, perSecond: made.picturesPerSecond };
        };
        clearTimeout(late);
        // The last one is written in any case.
        if (performance.now() - written_ms > kEvery_ms) write();
        else late = setTimeout(write, kEvery_ms);
      },
      told: (sentence) => notify(toldInOwnWords(sentence)),
      saved: (plan) => {
        kept.current = steps.peek();
        notify(t('planning.saved', { plan }), 'done');
        announce(t('planning.saved', { plan }));
      },
      lost: (sentence) => leave(sentence || t('planning.lost')),
    });
    return made;
  }, [open]);
  useEffect(() => () => table.leave(), [table]);
  const mayLeave = () => steps.peek() === kept.current || steps.peek().steps.length === 0 || confirm(t('planning.leave'));
  useEffect(() => askBeforeLeaving(mayLeave), [table]);
  useEffect(() => {
    const timer = setInterval(() => {
      const since = table.waitsSince_ms.value;
      slow.value = since !== undefined && performance.now() - since > kSlow_ms;
    }, 200);
    return () => clearInterval(timer);
  }, [table]);

  const placed = (event: PointerEvent): OnPicture => ({
    id: event.pointerId,
    ...placeOn(field.current as HTMLDivElement, event),
    at_ms: event.timeStamp,
    pan: event.shiftKey,
    ...(event.pointerType === 'pen' ? { pen: { twist_deg: event.twist, pressure: event.pressure, tilt_x_deg: event.tiltX, tilt_y_deg: event.tiltY } } : {}),
  });
  useField(field, { wheel: (event) => table.wheel(event.deltaY || event.deltaX, event.shiftKey, event.timeStamp), hidden: () => table.letGo() }, table);
  useEffect(() => {
    const key = (event: KeyboardEvent) => {
      const target = event.target as HTMLElement;
      if (document.querySelector('dialog[open]') || hasKeysOfItsOwn(target, event) || event.altKey) return;
      if (short(event)) event.preventDefault();
      else if (!event.ctrlKey && !event.metaKey && target === field.current && table.key(event.key, event.shiftKey, event.timeStamp)) event.preventDefault();
    };
    document.addEventListener('keydown', key);
    return () => document.removeEventListener('keydown', key);
  }, [table]);

  /** Whether the key is a shortcut. */
  const short = (event: KeyboardEvent): boolean => {
    const key = event.key.toLowerCase();
    if (event.ctrlKey || event.metaKey) {
      if (key === 'z') table.send(event.shiftKey ? { redo: true } : { undo: true });
      else if (key === 'y') table.send({ redo: true });
      else if (key === 's') saving.value = steps.value.steps.length > 0;
      else return false;
      return true;
    }
    const tool = kTools.find((one) => kKeyOfTool[one] === key);
    if (tool) choose(tool);
    else if (key === 's') table.showStress(!table.stress.value);
    else if (key === 'h') table.send({ hold: { duration_s: kHold_s } });
    else return false;
    return true;
  };
  const choose = (tool: Tool) => {
    table.choose(tool);
    announce(t(`planning.tool.${tool}`));
    field.current?.focus();
  };

  const now = moment.value;
  const told = opened.value;
  const tool = table.tool.value;
  const cursor = table.cursor.value;
  return (
    <main id="main" class="main pad planning" tabIndex={-1}>
      <div class="view-head">
        <h1>{told ? told.name || told.plan : t('planning.title')}</h1>
        <div class="attempt-do">
          <button type="button" class="button" disabled={!steps.value.undo} onClick={() => table.send({ undo: true })} title="Ctrl+Z">
            <Icon name="undo" />
            {t('planning.undo')}
          </button>
          <button type="button" class="button" disabled={!steps.value.redo} onClick={() => table.send({ redo: true })} title="Ctrl+Shift+Z">
            <Icon name="redo" />
            {t('planning.redo')}
          </button>
          <button type="button" class="button button-main" disabled={steps.value.steps.length === 0} onClick={() => (saving.value = true)} title="Ctrl+S">
            <Icon name="save" />
            {t('planning.save')}
          </button>
          <button type="button" class="button button-quiet" onClick={() => mayLeave() && leave()}>
            {t('planning.close')}
          </button>
        </div>
      </div>
      <Palette table={table} choose={choose} />
      <div class="attempt-body">
        <div class="attempt-picture">
          <div
            ref={field}
            class={`attempt-field planning-field planning-field-${tool}`}
            role="application"
            tabIndex={0}
            aria-label={t('planning.picture')}
            aria-busy={told === undefined}
            data-waits={table.waitsSince_ms.value !== undefined}
            onPointerDown={(event) => {
              if (event.button !== 0 || !told) return;
              const handle = handleOf(event);
              if (!(handle ? table.pressHandle(placed(event), handle) : table.press(placed(event)))) return;
              // Keys go on with the handle that was taken, where there is one.
              (handle ? (event.target as Element).closest('button') : field.current)?.focus();
              field.current?.setPointerCapture(event.pointerId);
              table.cursor.value = undefined;
            }}
            onPointerMove={(event) => table.move(placed(event))}
            onPointerUp={(event) => table.release(placed(event))}
            onPointerCancel={(event) => table.cancel(event.pointerId, event.timeStamp)}
            onContextMenu={(event) => event.preventDefault()}
            onBlur={() => (table.cursor.value = undefined)}
          >
            <canvas ref={canvas} width={kWidth} height={kHeight} aria-hidden="true" />
            {table.line.value.length > 0 && (
              <svg class="planning-line" viewBox="0 0 1 1" preserveAspectRatio="none" aria-hidden="true">
                <polyline points={table.line.value.map(({ x, y }) => `${x},${y}`).join(' ')} />
              </svg>
            )}
            {tool === 'cut' && <CutMarks table={table} focusField={() => field.current?.focus()} />}
            {now?.tools.map((one) => (
              <span key={one.name} class="planning-mark" style={{ left: `${one.x * 100}%`, top: `${one.y * 100}%` }} aria-hidden="true">
                {one.name}
              </span>
            ))}
            {cursor && tool !== 'orbit' && (
              <span
                class={table.keysAreDown ? 'key-mark key-mark-down' : 'key-mark'}
                style={{ left: `${cursor.x * 100}%`, top: `${cursor.y * 100}%` }}
                aria-hidden="true"
              />
            )}
            {!told && <p class="attempt-making">{opening.value || t('planning.opening')}</p>}
            {told && slow.value && <p class="planning-slow">{t('planning.computing')}</p>}
          </div>
          {table.stress.value && <StressScale most={table.largest_pa.value} label={t('planning.scale')} />}
          <p class="muted attempt-how">{t(`planning.how.${tool}`)}</p>
        </div>
        <div class="attempt-side">
          <StressCard table={table} now={now} />
          <ForceList tools={now?.tools ?? []} release={(name) => table.send({ release: { tool: name } })} close={(name, opens) => table.close(name, opens)} />
          <StepList steps={steps.value.steps} />
          <p class="muted attempt-latency">
            {rate.value.latency_ms !== undefined && t('planning.latency', { picture: rate.value.latency_ms.toFixed(0), rate: rate.value.perSecond.toFixed(0) })}
          </p>
        </div>
      </div>
      {saving.value && told && (
        <SaveDialog
          name={told.name}
          file={`${stemOf(told.plan)}-2`}
          save={(file, name) => table.send({ save: { file, name } })}
          close={() => (saving.value = false)}
        />
      )}
    </main>
  );
}
