// What a person is told of a model that was saved. A seal without a time-stamp of an outside authority is no success: nothing outside this machine says when
// it was made.
import type { ModelSeal } from '@/breathing/breathing_api';
import { t } from '@/i18n/i18n';
import { toldInOwnWords } from '@/i18n/server_words';
import type { Notice } from '@/shell/state';

export function noticesOfSaved(file: string, seal: ModelSeal | null): Omit<Notice, 'id'>[] {
  if (!seal) return [{ text: t('planning.saved', { plan: file }), kind: 'done' }];
  const stamps = seal.time_stamps.filter(({ time }) => time !== '').length;
  const outside = seal.time_stamps.filter(({ time, kind }) => time !== '' && kind === 'external').length;
  const missing = seal.time_stamps.filter(({ problem }) => problem !== '');
  const why = missing.map(({ authority, problem }) => `${authority}: ${toldInOwnWords(problem)}`).join('; ');
  if (stamps === 0) return [{ text: t('breathing.sealedUntimed', { file, seal: seal.file, why: why || t('breathing.noAuthority') }), kind: 'problem' }];
  const done: Omit<Notice, 'id'> =
    outside === 0
      ? { text: t('breathing.sealedByOwn', { file, seal: seal.file, stamps }), kind: 'problem' }
      : outside === stamps
        ? { text: t('breathing.sealed', { file, seal: seal.file, stamps }), kind: 'done' }
        : { text: t('breathing.sealedByBoth', { file, seal: seal.file, outside, own: stamps - outside }), kind: 'done' };
  return missing.length === 0 ? [done] : [done, { text: t('breathing.stampMissing', { why }), kind: 'problem' }];
}
