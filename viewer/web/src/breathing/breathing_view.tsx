// A breathing lung beside its radiographs: the picture, its time line, sliders, and what they come to.
import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { typed } from '@/base/form_fields';
import { askBeforeLeaving, hrefOf, route } from '@/base/route';
import { formatTime, kSecond } from '@/base/time';
import { type FluoroscopyOfCase, kModes, type Mode, type OpenedLung } from '@/breathing/breathing_api';
import { FitCard } from '@/breathing/fit_card';
import { GroupPainter } from '@/breathing/group_painter';
import { LungController } from '@/breathing/lung_controller';
import { countOf } from '@/breathing/lung_surface';
import { kGroups } from '@/breathing/motion';
import { GroupSliders, WaveformCard } from '@/breathing/motion_sliders';
import { noticesOfSaved } from '@/breathing/saved_notices';
import { beginOf, distances, meanOf, momentAt } from '@/breathing/time_line';
import { TimePlot } from '@/breathing/time_plot';
import { t, word } from '@/i18n/i18n';
import { inOwnWords } from '@/i18n/server_words';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';
import { announce, notify, session } from '@/shell/state';
import { StateCard } from '@/shell/state_card';
import { lookForWorkplaces } from '@/shell/workplaces';

const kKeyOfMode: Record<Mode, string> = { beside: 'b', opacity: 'o', wipe: 'w', difference: 'd', contour: 'c' };
const kAxes = ['x', 'y', 'z'] as const;

const stemOf = (file: string) => file.replace(/\.json$/, '');
/** From the picture's left edge, 0, to its right, 1: beside it the canvas is black. */
function alongPicture(canvas: HTMLCanvasElement, event: PointerEvent): number {
  const box = canvas.getBoundingClientRect();
  const shown = Math.min(box.width, (box.height * canvas.width) / canvas.height);
  return 0.5 + (event.clientX - box.left - box.width / 2) / shown;
}
const within = (value: number) => Math.min(1, Math.max(0, value));

interface Wanted {
  id: string;
  stream: string;
}
const isOf = (recording: FluoroscopyOfCase | null, wanted: Wanted) => recording?.case === wanted.id && recording.stream === wanted.stream;

/** Somebody came for a case's fluoroscopy, and the workbench has other radiographs. */
function OtherLung({ wanted, opened, again }: { wanted: Wanted; opened: OpenedLung; again: () => void }) {
  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <div class="view-head">
        <h1>{t('nav.breathing')}</h1>
      </div>
      <StateCard
        icon="lung"
        title={t('breathing.other')}
        what={t(opened.recording ? 'breathing.otherCase' : 'breathing.otherAlone', {
          file: opened.file,
          case: opened.recording?.case ?? '',
          stream: opened.recording?.stream ?? '',
        })}
      >
        <p>{t('breathing.otherDo')}</p>
        <p class="mono">
          kiroku respire serve CT LUNG.json --case {wanted.id} --stream {wanted.stream}
        </p>
        <button type="button" class="button button-main" onClick={again}>
          {t('state.again')}
        </button>
        <a class="button" href={hrefOf({ view: 'breathing' })}>
          {t('breathing.otherOpen')}
        </a>
        <a class="button" href={hrefOf({ view: 'case', id: wanted.id })}>
          {t('breathing.backToCase')}
        </a>
      </StateCard>
    </main>
  );
}

export function BreathingView() {
  const lost = useSignal<string | undefined>(undefined);
  const visit = useSignal(0);
  const other = useSignal<OpenedLung | undefined>(undefined);
  const wanted = route.value.view === 'breathing' ? route.value.recording : undefined;
  // What was open when somebody came for another case says nothing later.
  useEffect(() => {
    other.value = undefined;
  }, [wanted?.id, wanted?.stream]);
  useEffect(() => {
    document.title = `${t('nav.breathing')} · Kiroku`;
  });
  if (wanted && other.value && !isOf(other.value.recording, wanted))
    return <OtherLung wanted={wanted} opened={other.value} again={() => (other.value = undefined)} />;
  if (lost.value !== undefined) {
    return (
      <main id="main" class="main narrow" tabIndex={-1}>
        <div class="view-head">
          <h1>{t('nav.breathing')}</h1>
        </div>
        <StateCard icon="alarm" title={t('breathing.ended')} what={lost.value || t('breathing.lost')}>
          <button
            type="button"
            class="button button-main"
            onClick={() => {
              lost.value = undefined;
              visit.value += 1;
            }}
          >
            {t('state.again')}
          </button>
        </StateCard>
      </main>
    );
  }
  return (
    <LungView
      key={`${visit.value} ${wanted?.id} ${wanted?.stream}`}
      wanted={wanted}
      isOther={(opened) => (other.value = opened)}
      leave={(sentence) => {
        lost.value = sentence;
        void lookForWorkplaces();
      }}
    />
  );
}

/** The way back to the case, at the moment of the first picture. */
function CaseCrumbs({ recording }: { recording: FluoroscopyOfCase }) {
  const { case: id, stream, first_s } = recording;
  const isHere = session.value?.serves === 'cases';
  return (
    <p class="crumbs">
      {isHere ? (
        <a class="mono" href={hrefOf({ view: 'case', id, at_ns: Math.round(first_s * kSecond) })}>
          {id}
        </a>
      ) : (
        <span class="mono">{id}</span>
      )}
      <span aria-hidden="true">/</span>
      <span>{t('breathing.ofCase', { stream: word('stream', stream), at: formatTime(Math.round(first_s * kSecond)) })}</span>
    </p>
  );
}

function SaveDialog({ file, maySeal, save, close }: { file: string; maySeal: boolean; save: (file: string, seal: boolean) => void; close: () => void }) {
  return (
    <Dialog title={t('breathing.save')} onClose={close}>
      <form
        class="form"
        method="dialog"
        onSubmit={(event) => {
          const form = new FormData(event.currentTarget);
          save(typed(form, 'file').trim(), form.has('seal'));
        }}
      >
        <label class="field">
          <span>{t('planning.saveFile')}</span>
          <input name="file" required maxLength={100} defaultValue={file} autocomplete="off" />
        </label>
        <p class="muted">{t('breathing.saveWhat')}</p>
        {maySeal && (
          <label class="train-check">
            <input type="checkbox" name="seal" />
            <span>{t('breathing.seal')}</span>
          </label>
        )}
        <button type="submit" class="button button-main">
          <Icon name="save" />
          {t('planning.saveDo')}
        </button>
      </form>
    </Dialog>
  );
}

interface LungProps {
  wanted: Wanted | undefined;
  isOther: (opened: OpenedLung) => void;
  leave: (sentence: string) => void;
}
function LungView({ wanted, isOther, leave }: LungProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const field = useRef<HTMLDivElement>(null);
  const saving = useSignal(false);

  const lung = useMemo(() => {
    const made: LungController = new LungController({
      opened: (opened) => {
        if (wanted && !isOf(opened.recording, wanted)) return isOther(opened);
        for (const warning of opened.warnings) notify(warning);
        announce(t('planning.opened', { name: opened.file }));
        field.current?.focus();
      },
      picture: (picture) => {
        const to = canvas.current;
        const rows = made.opened.peek()?.rows;
        if (!to || rows === undefined) return;
        // Pictures come of fewer pixels while something moves.
        const wide = Math.round((picture.width / picture.height) * rows);
        if (to.width !== wide || to.height !== rows) [to.width, to.height] = [wide, rows];
        to.getContext('2d')?.drawImage(picture, 0, 0, wide, rows);
        // Whether this one is of all pixels.
        to.dataset['rows'] = String(picture.height);
      },
      told: (sentence) => notify(inOwnWords(sentence, 409)),
      fitted: (fitted) => {
        if (fitted.refusal === null) announce(t('breathing.fit.found', { took: fitted.took_s.toFixed(1) }));
      },
      saved: (file, seal) => {
        const told = noticesOfSaved(file, seal);
        for (const { text, kind } of told) notify(text, kind);
        announce(told.map(({ text }) => text).join(' '));
      },
      lost: (sentence) => leave(sentence && inOwnWords(sentence, 409)),
    });
    return made;
  }, []);
  useEffect(() => () => lung.leave(), [lung]);
  useEffect(() => askBeforeLeaving(() => lung.steps.peek().saved || confirm(t('breathing.leave'))), [lung]);

  const choose = (mode: Mode) => {
    lung.lookAs({ mode });
    announce(t(`breathing.mode.${mode}`));
  };
  useEffect(() => {
    /** Whether the key does something. */
    const act = (event: KeyboardEvent): boolean => {
      const key = event.key.toLowerCase();
      if (event.ctrlKey || event.metaKey) {
        if (key === 'z' && event.shiftKey) lung.redo();
        else if (key === 'z') lung.undo();
        else if (key === 'y') lung.redo();
        else if (key === 's') saving.value = true;
        else return false;
        return true;
      }
      // Buttons, sliders and lists have these keys for themselves.
      const own = /^(INPUT|SELECT|BUTTON|SUMMARY|A)$/.test((event.target as HTMLElement).tagName);
      if (key === ' ' && !own) lung.toggle();
      else if (key === 'arrowleft' && !own) lung.step(-1);
      else if (key === 'arrowright' && !own) lung.step(1);
      else {
        const mode = lung.opened.peek()?.radiographs ? kModes.find((one) => kKeyOfMode[one] === key) : undefined;
        if (mode) choose(mode);
        else if (key === 't') lung.lookAs({ outlined: !lung.look.peek().outlined });
        else return false;
      }
      return true;
    };
    const listen = (event: KeyboardEvent) => {
      if (document.querySelector('dialog[open]') || event.altKey || /^(TEXTAREA)$/.test((event.target as HTMLElement).tagName)) return;
      if (act(event)) event.preventDefault();
    };
    document.addEventListener('keydown', listen);
    return () => document.removeEventListener('keydown', listen);
  }, [lung]);

  const opened = lung.opened.value;
  const motion = lung.motion.value;
  const surface = lung.surface.value;
  const path = lung.path.value;
  const look = lung.look.value;
  const moment = lung.moment.value;
  const { undo, redo, saved } = lung.steps.value;
  const line = lung.line;
  const end_s = beginOf(line) + line.duration_s;
  const time_s = moment?.time_s ?? lung.time_s.value;
  const alike = lung.similarity.value;
  const measured = alike && path && alike.revision === path.revision ? alike.values.filter((one): one is number => one !== null) : [];
  const withSeries = (opened?.radiographs ?? 0) > 0;
  const fit = lung.fit.value;
  const seen = fit && fit.tumour.length > 0 ? fit.tumour : undefined;
  const off = seen && path ? distances(seen, path.mm) : [];
  const wipes = withSeries && look.mode === 'wipe';
  const drag = (event: PointerEvent) => {
    if (wipes && event.buttons > 0 && canvas.current) lung.lookAs({ part: within(alongPicture(canvas.current, event)) });
  };
  return (
    <main id="main" class="main pad breathing" tabIndex={-1}>
      <div class="view-head">
        <div>
          {opened?.recording && <CaseCrumbs recording={opened.recording} />}
          <h1>
            {t('breathing.title')} {opened && <small class="muted">{opened.file}</small>}
          </h1>
        </div>
        <div class="attempt-do">
          <button type="button" class="button" disabled={!undo} onClick={() => lung.undo()} title="Ctrl+Z">
            <Icon name="undo" />
            {t('planning.undo')}
          </button>
          <button type="button" class="button" disabled={!redo} onClick={() => lung.redo()} title="Ctrl+Shift+Z">
            <Icon name="redo" />
            {t('planning.redo')}
          </button>
          <button type="button" class="button button-main" disabled={!opened} onClick={() => (saving.value = true)} title="Ctrl+S">
            <Icon name="save" />
            {t('planning.save')}
            {!saved && <span class="only-heard"> ({t('breathing.unsaved')})</span>}
          </button>
        </div>
      </div>
      <div class="lung-body">
        <div class="lung-seen">
          {withSeries && (
            <div class="lung-modes" role="toolbar" aria-label={t('breathing.modes')}>
              {kModes.map((mode) => (
                <button key={mode} type="button" class="button" aria-pressed={look.mode === mode} onClick={() => choose(mode)}>
                  {t(`breathing.mode.${mode}`)} <kbd>{kKeyOfMode[mode].toUpperCase()}</kbd>
                </button>
              ))}
              {(look.mode === 'opacity' || look.mode === 'wipe') && (
                <label class="lung-part">
                  <span>{t(look.mode === 'wipe' ? 'breathing.edge' : 'breathing.blend')}</span>
                  <input
                    type="range"
                    min="0"
                    max="1"
                    step="0.01"
                    value={look.part}
                    onInput={(event) => lung.lookAs({ part: Number(event.currentTarget.value) })}
                  />
                </label>
              )}
            </div>
          )}
          <div
            ref={field}
            class={wipes ? 'lung-field lung-field-wipe' : 'lung-field'}
            role="application"
            tabIndex={0}
            aria-label={t(withSeries ? 'breathing.picture' : 'breathing.pictureAlone')}
            aria-busy={moment === undefined}
            onPointerDown={(event) => {
              field.current?.setPointerCapture(event.pointerId);
              drag(event);
            }}
            onPointerMove={drag}
          >
            <canvas ref={canvas} aria-hidden="true" />
            {withSeries && look.mode === 'beside' && moment && (
              <>
                <span class="lung-tag">{t('breathing.radiograph')}</span>
                <span class="lung-tag lung-tag-right">{t('breathing.computed')}</span>
              </>
            )}
            {!moment && <p class="attempt-making">{t('breathing.opening')}</p>}
          </div>
          <div class="lung-time">
            <button type="button" class="button button-square" aria-label={t('breathing.back')} title="←" onClick={() => lung.step(-1)}>
              <Icon name="stepBack" />
            </button>
            <button
              type="button"
              class="button button-square"
              aria-label={t(lung.playing.value ? 'breathing.pause' : 'breathing.play')}
              onClick={() => lung.toggle()}
            >
              <Icon name={lung.playing.value ? 'pause' : 'play'} />
            </button>
            <button type="button" class="button button-square" aria-label={t('breathing.on')} title="→" onClick={() => lung.step(1)}>
              <Icon name="stepForward" />
            </button>
            <input
              type="range"
              class="lung-line"
              aria-label={t('breathing.time')}
              aria-valuetext={`${time_s.toFixed(2)} s`}
              min={beginOf(line)}
              max={end_s}
              step="any"
              value={lung.time_s.value}
              onInput={(event) => {
                lung.pause();
                lung.goTo(Number(event.currentTarget.value));
              }}
            />
            <span class="mono lung-clock">
              {time_s.toFixed(2)} s{withSeries && ` · ${momentAt(line, time_s) + 1}/${opened?.radiographs ?? 0}`}
            </span>
            <label class="train-check">
              <input type="checkbox" checked={look.outlined} onChange={(event) => lung.lookAs({ outlined: event.currentTarget.checked })} />
              <span>
                {t('breathing.outline')} <kbd>T</kbd>
              </span>
            </label>
          </div>
          <p class="muted attempt-latency">
            {lung.rate.value.latency_ms !== undefined &&
              t('planning.latency', { picture: lung.rate.value.latency_ms.toFixed(0), rate: lung.rate.value.perSecond.toFixed(0) })}
          </p>
          {path && (
            <div class="lung-plots">
              <TimePlot
                title={t(seen ? 'breathing.pathSeen' : 'breathing.path')}
                unit="mm"
                digits={1}
                times_s={path.times_s}
                end_s={end_s}
                curves={[
                  ...kAxes.map((axis, i) => ({ name: t(`breathing.axis.${axis}`), values: path.mm.map((one) => one[i] ?? null) })),
                  ...(seen ? kAxes.map((axis, i) => ({ name: `seen ${axis}`, values: seen.map((one) => one?.mm[i] ?? null), pointsOf: i })) : []),
                ]}
                now_s={time_s}
                seek={(at_s) => lung.goTo(at_s)}
              />
              {withSeries && (
                <TimePlot
                  title={
                    measured.length > 0
                      ? t('breathing.similarityOf', {
                          mean: meanOf(measured).toFixed(3),
                          n: measured.length,
                          all: opened?.radiographs ?? 0,
                        })
                      : t('breathing.similarity')
                  }
                  unit=""
                  digits={3}
                  times_s={path.times_s}
                  end_s={end_s}
                  curves={[{ name: t('breathing.similarity'), values: alike && alike.revision === path.revision ? alike.values : [] }]}
                  now_s={time_s}
                  seek={(at_s) => lung.goTo(at_s)}
                />
              )}
              {seen && (
                <TimePlot
                  title={t('breathing.offOf', { mean: meanOf(off).toFixed(2), n: off.filter((one) => one !== null).length })}
                  unit="mm"
                  digits={2}
                  times_s={path.times_s}
                  end_s={end_s}
                  curves={[{ name: t('breathing.off'), values: off }]}
                  now_s={time_s}
                  seek={(at_s) => lung.goTo(at_s)}
                />
              )}
            </div>
          )}
        </div>
        {opened && motion && (
          <div class="lung-side">
            {withSeries && <FitCard lung={lung} motion={motion} canFit={opened.can_fit} />}
            {kGroups.map((group) => (
              <GroupSliders
                key={group}
                lung={lung}
                motion={motion}
                group={group}
                nodes={motion.groups ? countOf(motion.groups, group) : (opened.groups[group] ?? 0)}
              />
            ))}
            <WaveformCard lung={lung} motion={motion} />
            {surface && <GroupPainter lung={lung} surface={surface} motion={motion} />}
            {surface === null && <p class="muted">{t('breathing.groups.tooMany')}</p>}
          </div>
        )}
      </div>
      {saving.value && opened && (
        <SaveDialog
          file={`${stemOf(opened.file)}-2`}
          maySeal={opened.may_seal}
          save={(file, seal) => lung.save(file, seal)}
          close={() => (saving.value = false)}
        />
      )}
    </main>
  );
}
