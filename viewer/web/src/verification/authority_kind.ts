// Whose clock an authority has, beside its name: whoever sets a recorder up chooses the name of its own authority.
import { t } from '@/i18n/i18n';

export function nameWithKind(name: string, kind: 'external' | 'self-issued' | 'none'): string {
  return kind === 'self-issued' ? t('authority.selfIssued', { name }) : name;
}
