// What a view asks first of the program behind its page. While that fails the view says why, and asks again by itself.
import { type ReadonlySignal, useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { t } from '@/i18n/i18n';
import { notifyOf, textOf } from '@/shell/state';
import { StateCard } from '@/shell/state_card';
import { lookForWorkplaces } from '@/shell/workplaces';

const kAgain_ms = 4_000;

export interface Asked<T> {
  /** The newest answer; what was answered before stays while a later question fails. */
  answer: ReadonlySignal<T | undefined>;
  /** Why there is none yet. */
  problem: ReadonlySignal<string | undefined>;
  ask: () => Promise<void>;
}

export function useAsked<T>(question: () => Promise<T>): Asked<T> {
  const answer = useSignal<T | undefined>(undefined);
  const problem = useSignal<string | undefined>(undefined);
  const ask = async () => {
    try {
      answer.value = await question();
      problem.value = undefined;
    } catch (error) {
      if (answer.peek() === undefined) problem.value = textOf(error);
      else notifyOf(error);
      await lookForWorkplaces();
    }
  };
  useEffect(() => {
    void ask();
    const timer = setInterval(() => {
      if (problem.peek() !== undefined) void ask();
    }, kAgain_ms);
    return () => clearInterval(timer);
  }, []);
  return { answer, problem, ask };
}

/** In place of a view that has no answer yet. */
export function WithoutAnswer<T>({ asked, title }: { asked: Asked<T>; title: string }) {
  const why = asked.problem.value;
  if (why === undefined) return <main id="main" class="main narrow" tabIndex={-1} aria-busy="true" />;
  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <div class="view-head">
        <h1>{title}</h1>
      </div>
      <StateCard icon="alarm" title={t('state.noAnswer')} what={t('state.noAnswerWhat')} why={why}>
        <button type="button" class="button button-main" onClick={() => void asked.ask()}>
          {t('state.again')}
        </button>
      </StateCard>
    </main>
  );
}
