// The trainer: who trains, on what; then the attempt; then what came of it.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { typed } from '@/base/form_fields';
import { formatTime, kSecond } from '@/base/time';
import { t, word } from '@/i18n/i18n';
import { attempt, notify } from '@/shell/state';
import { useAsked, WithoutAnswer } from '@/shell/use_asked';
import { AttemptView } from '@/training/attempt_view';
import { objectLabel } from '@/training/object_label';
import { ResultView } from '@/training/result_view';
import { training as api, type Began, type Begin, type Instrument, kInstruments, type Over, type Training } from '@/training/training_api';

const kStored = 'kiroku.training';

interface Choice {
  trainee: string;
  object: string;
  fingers: number;
  expert: boolean;
  press: boolean;
  instrument: Instrument;
}

function storedChoice(): Choice {
  const first: Choice = { trainee: '', object: 'a', fingers: 3, expert: false, press: false, instrument: '' };
  try {
    return { ...first, ...(JSON.parse(localStorage.getItem(kStored) ?? '{}') as Partial<Choice>) };
  } catch {
    return first;
  }
}

/** Instruments are for practice, without an expert's hand, which has fingertips. */
function beginWith({ instrument, ...choice }: Choice, test: boolean): Begin {
  return test || instrument === '' ? { ...choice, test } : { ...choice, test, expert: false, instrument };
}

type Stage = { at: 'choose' } | { at: 'attempt'; begin: Begin } | { at: 'result'; begin: Begin; came?: { began: Began; over: Over } };

function AddTrainee({ groups, supervises, added }: { groups: string[]; supervises: boolean; added: (name: string) => Promise<unknown> }) {
  const add = async (event: SubmitEvent) => {
    event.preventDefault();
    const form = event.currentTarget as HTMLFormElement;
    const fields = new FormData(form);
    const name = typed(fields, 'name').trim();
    await attempt(async () => {
      await api.addTrainee(name, typed(fields, 'group'), typed(fields, 'user').trim());
      form.reset();
      notify(t('train.added', { name }), 'done');
      await added(name);
    });
  };
  return (
    <form class="card form-row train-add" onSubmit={(event) => void add(event)} aria-label={t('train.add')}>
      <h2>{t('train.add')}</h2>
      <label class="field">
        <span>{t('train.name')}</span>
        <input name="name" required maxLength={40} autocomplete="off" />
      </label>
      <label class="field">
        <span>{t('train.group')}</span>
        <select name="group">
          {groups.map((group) => (
            <option key={group} value={group}>
              {word('group', group)}
            </option>
          ))}
        </select>
      </label>
      {supervises && (
        <label class="field">
          <span>{t('train.user')}</span>
          <input name="user" maxLength={64} autocomplete="off" aria-describedby="train-user-what" />
        </label>
      )}
      <button type="submit" class="button button-main">
        {t('train.addDo')}
      </button>
      <p class="muted">{t('train.groupWhat')}</p>
      {supervises && (
        <p class="muted" id="train-user-what">
          {t('train.userWhat')}
        </p>
      )}
    </form>
  );
}

export function TrainingView() {
  const known = useAsked<Training>(api.get);
  const choice = useSignal<Choice>(storedChoice());
  const stage = useSignal<Stage>({ at: 'choose' });
  useEffect(() => {
    document.title = `${t('nav.training')} · Kiroku`;
  });
  const choose = (change: Partial<Choice>) => {
    choice.value = { ...choice.value, ...change };
    localStorage.setItem(kStored, JSON.stringify(choice.value));
  };
  const choosing = () => {
    stage.value = { at: 'choose' };
    void known.ask();
  };

  const now = stage.value;
  if (now.at === 'attempt') {
    return (
      <AttemptView
        begin={now.begin}
        over={(began, over) => (stage.value = { at: 'result', begin: now.begin, came: { began, over } })}
        lost={(sentence) => {
          notify(sentence || t('attempt.lost'));
          choosing();
        }}
      />
    );
  }
  if (now.at === 'result') {
    return (
      <ResultView
        begin={now.begin}
        {...(now.came ? { came: now.came } : {})}
        training={known.answer.value}
        again={(test) => (stage.value = { at: 'attempt', begin: beginWith({ ...now.begin, instrument: now.begin.instrument ?? '' }, test) })}
        other={choosing}
      />
    );
  }

  const training = known.answer.value;
  if (!training) return <WithoutAnswer asked={known} title={t('nav.training')} />;
  const trainee = training.trainees.find((one) => one.name === choice.value.trainee);
  // A patient's organ that was chosen before may not be served any more.
  const object = training.objects.includes(choice.value.object) ? choice.value.object : 'a';
  const progress = trainee?.progress[object];
  const hasExpert = training.experts.includes(object);
  const beginOf = (test: boolean): Begin => beginWith({ ...choice.value, object }, test);
  const go = (begin: Begin) => (stage.value = { at: 'attempt', begin: { ...begin, expert: begin.expert && hasExpert } });
  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <div class="view-head">
        <h1>{t('train.title')}</h1>
      </div>
      <p class="train-what">{t('train.what')}</p>
      <section class="card train-choice" aria-label={t('train.title')}>
        <label class="field">
          <span>{t('train.trainee')}</span>
          <select value={trainee?.name ?? ''} onChange={(event) => choose({ trainee: event.currentTarget.value })}>
            <option value="">{t('train.choose')}</option>
            {training.trainees.map((one) => (
              <option key={one.name} value={one.name}>
                {one.group === '' ? one.name : `${one.name} · ${word('group', one.group)}`}
              </option>
            ))}
          </select>
        </label>
        <label class="field">
          <span>{t('train.object')}</span>
          <select value={object} onChange={(event) => choose({ object: event.currentTarget.value })}>
            {training.objects.map((one) => (
              <option key={one} value={one}>
                {objectLabel(one)}
              </option>
            ))}
          </select>
        </label>
        <label class="field">
          <span>{t('train.fingers')}</span>
          <select value={choice.value.fingers} onChange={(event) => choose({ fingers: Number(event.currentTarget.value) })}>
            {Array.from({ length: training.fingers }, (_, i) => i + 1).map((count) => (
              <option key={count} value={count}>
                {count}
              </option>
            ))}
          </select>
        </label>
        <label class="field">
          <span>{t('train.instrument')}</span>
          <select
            value={choice.value.instrument}
            onChange={(event) => choose({ instrument: event.currentTarget.value as Instrument })}
            aria-describedby="train-instrument-what"
          >
            {kInstruments.map((one) => (
              <option key={one} value={one}>
                {word('instrument', one || 'fingertips')}
              </option>
            ))}
          </select>
        </label>
        <p class="muted" id="train-instrument-what">
          {t('train.instrumentWhat')}
        </p>
        {training.doubted.includes(object) && <p class="train-doubt">{t('train.doubted')}</p>}
        {hasExpert && (
          <label class="train-check">
            <input type="checkbox" checked={choice.value.expert} onChange={(event) => choose({ expert: event.currentTarget.checked })} />
            <span>{t('train.expert')}</span>
          </label>
        )}
        <label class="train-check">
          <input type="checkbox" checked={choice.value.press} onChange={(event) => choose({ press: event.currentTarget.checked })} />
          <span>{t('train.press')}</span>
        </label>
        <p class="muted train-progress">
          {training.trainees.length === 0 && t('train.nobody')}
          {progress &&
            (training.practice_s > 0
              ? t('train.progress', {
                  session: progress.session,
                  done: formatTime(Math.round(progress.practised_s) * kSecond),
                  all: formatTime(training.practice_s * kSecond),
                })
              : t('train.session', { session: progress.session }))}
        </p>
        <div class="train-do">
          <button type="button" class="button button-main" disabled={!trainee} onClick={() => go(beginOf(false))}>
            {t('train.practise')}
          </button>
          <button type="button" class="button" disabled={!trainee} onClick={() => go(beginOf(true))}>
            {t('train.test')}
          </button>
          <button type="button" class="button button-quiet" disabled={!trainee} onClick={() => (stage.value = { at: 'result', begin: beginOf(false) })}>
            {t('train.results')}
          </button>
        </div>
      </section>
      <AddTrainee
        groups={training.groups}
        supervises={training.supervises}
        added={async (name) => {
          await known.ask();
          choose({ trainee: name });
        }}
      />
    </main>
  );
}
