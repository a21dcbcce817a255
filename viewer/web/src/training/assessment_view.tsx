// What is said of an attempt: the study's questionnaire, and an examiner's checklist. What a case holds is shown and no
// more asked.
import { typed } from '@/base/form_fields';
import { t, word } from '@/i18n/i18n';
import { announce, attempt as trying, notify } from '@/shell/state';
import { type AttemptKept, type ItemState, kAnswers, kItemStates, kRatings, training as api, type Training } from '@/training/training_api';

const signed = (answer: number | null | undefined) =>
  answer === null || answer === undefined ? '–' : answer > 0 ? `+${answer}` : answer < 0 ? `−${-answer}` : '0';

/** "+1, +2, –" and "6 of 7 done; 4, good (Dr Sato)"; empty where nothing was said. */
export function assessmentText(kept: AttemptKept): string {
  const parts: string[] = [];
  if (kept.questionnaire) parts.push(Object.values(kept.questionnaire.answers).map(signed).join(', '));
  if (kept.checklist) {
    const states = Object.values(kept.checklist.items);
    parts.push(
      t('assess.inShort', {
        done: states.filter((state) => state === 'done').length,
        seen: states.filter((state) => state !== 'not-seen').length,
        rating: kept.checklist.global_rating,
        examiner: kept.checklist.examiner,
      }),
    );
  }
  return parts.join(' · ');
}

function Questionnaire({ kept, questions, saved }: { kept: AttemptKept; questions: string[]; saved: () => Promise<unknown> }) {
  const save = async (event: SubmitEvent) => {
    event.preventDefault();
    const fields = new FormData(event.currentTarget as HTMLFormElement);
    const answers = Object.fromEntries(
      questions.map((question): [string, number | null] => {
        const value = typed(fields, question);
        return [question, value === '' ? null : Number(value)];
      }),
    );
    const comment = typed(fields, 'comment').replaceAll('\r\n', '\n').trim();
    if (comment === '' && Object.values(answers).every((answer) => answer === null)) {
      notify(t('assess.nothing'));
      return;
    }
    await trying(async () => {
      await api.keepQuestionnaire(kept.attempt, { answers, comment });
      announce(t('assess.kept'));
      await saved();
    });
  };
  return (
    <form class="assess-form" onSubmit={(event) => void save(event)} aria-label={t('assess.questionnaire')}>
      {questions.map((question) => (
        <label class="field" key={question}>
          <span>{word('assess.question', question)}</span>
          <select name={question}>
            <option value="">{t('assess.noAnswer')}</option>
            {kAnswers.map((answer) => (
              <option key={answer} value={answer} selected={kept.questionnaire?.answers[question] === answer}>
                {signed(answer)} {t(`assess.answer.${answer}`)}
              </option>
            ))}
          </select>
        </label>
      ))}
      <label class="field">
        <span>{t('assess.comment')}</span>
        <textarea name="comment" rows={3} maxLength={1500} defaultValue={kept.questionnaire?.comment ?? ''} />
      </label>
      <button type="submit" class="button">
        {t('assess.keep')}
      </button>
    </form>
  );
}

function Checklist({ kept, items, saved }: { kept: AttemptKept; items: string[]; saved: () => Promise<unknown> }) {
  const save = async (event: SubmitEvent) => {
    event.preventDefault();
    const fields = new FormData(event.currentTarget as HTMLFormElement);
    const states = Object.fromEntries(items.map((item): [string, ItemState] => [item, typed(fields, item) as ItemState]));
    await trying(async () => {
      await api.keepChecklist(kept.attempt, {
        items: states,
        global_rating: Number(typed(fields, 'rating')),
        examiner: typed(fields, 'examiner').trim(),
      });
      announce(t('assess.kept'));
      await saved();
    });
  };
  return (
    <form class="assess-form" onSubmit={(event) => void save(event)} aria-label={t('assess.checklist')}>
      {items.map((item) => (
        <label class="field" key={item}>
          <span>{word('assess.item', item)}</span>
          <select name={item} required>
            <option value="">{t('assess.choose')}</option>
            {kItemStates.map((state) => (
              <option key={state} value={state} selected={kept.checklist?.items[item] === state}>
                {t(`assess.state.${state}`)}
              </option>
            ))}
          </select>
        </label>
      ))}
      <label class="field">
        <span>{t('assess.rating')}</span>
        <select name="rating" required>
          <option value="">{t('assess.choose')}</option>
          {kRatings.map((rating) => (
            <option key={rating} value={rating} selected={kept.checklist?.global_rating === rating}>
              {rating} {t(`assess.rating.${rating}`)}
            </option>
          ))}
        </select>
      </label>
      <label class="field">
        <span>{t('assess.examiner')}</span>
        <input name="examiner" required maxLength={25} autocomplete="off" defaultValue={kept.checklist?.examiner ?? ''} />
      </label>
      <button type="submit" class="button">
        {t('assess.keep')}
      </button>
    </form>
  );
}

/** What was said, in words. */
function Said({ kept, questions, items }: { kept: AttemptKept; questions: string[]; items: string[] }) {
  const { questionnaire, checklist } = kept;
  return (
    <dl class="assess-said">
      {questionnaire &&
        questions.map((question) => (
          <div key={question}>
            <dt>{word('assess.question', question)}</dt>
            <dd>{signed(questionnaire.answers[question])}</dd>
          </div>
        ))}
      {questionnaire && questionnaire.comment !== '' && (
        <div>
          <dt>{t('assess.comment')}</dt>
          <dd class="assess-comment">{questionnaire.comment}</dd>
        </div>
      )}
      {checklist &&
        items.map((item) => (
          <div key={item}>
            <dt>{word('assess.item', item)}</dt>
            <dd>{checklist.items[item] ? t(`assess.state.${checklist.items[item]}`) : '–'}</dd>
          </div>
        ))}
      {checklist && (
        <div>
          <dt>{t('assess.rating')}</dt>
          <dd>
            {checklist.global_rating} {word('assess.rating', String(checklist.global_rating))} ({checklist.examiner})
          </dd>
        </div>
      )}
    </dl>
  );
}

export function Assessment({ kept, training, saved }: { kept: AttemptKept; training: Training; saved: () => Promise<unknown> }) {
  if (kept.ending === 'broken-off') return null;
  const { questions, checklist_items: items } = training;
  if (kept.case !== '') {
    if (!kept.questionnaire && !kept.checklist) return <p class="muted">{t('assess.sealedWithout')}</p>;
    return (
      <section class="assess" aria-label={t('assess.title')}>
        <h2>{t('assess.title')}</h2>
        <p class="muted">{t('assess.sealed')}</p>
        <Said kept={kept} questions={questions} items={items} />
      </section>
    );
  }
  return (
    <section class="assess" aria-label={t('assess.title')}>
      <h2>{t('assess.title')}</h2>
      <p class="muted">
        {assessmentText(kept) || t('assess.none')} {t('assess.what')}
      </p>
      <details>
        <summary>{t('assess.questionnaire')}</summary>
        <Questionnaire kept={kept} questions={questions} saved={saved} />
      </details>
      {training.supervises && (
        <details>
          <summary>{t('assess.checklist')}</summary>
          <Checklist kept={kept} items={items} saved={saved} />
        </details>
      )}
    </section>
  );
}
