// The names of those who look on in a room.
import { t } from '@/i18n/i18n';
import type { Company } from '@/pointing/company';
import { colorOf } from '@/pointing/pointers';
import { Icon } from '@/shell/icon';

export function Lookers({ company }: { company: Company | undefined }) {
  const watchers = company?.watchers.value ?? [];
  if (watchers.length === 0) return null;
  return (
    <p class="lookers">
      <Icon name="users" />
      <span class="only-heard">{t('point.watch')}</span>
      {watchers.map(({ name, role }) => (
        <span key={`${role} ${name}`} class={`looker pointer-${colorOf({ by: name, role })}`}>
          {role === 'guest' ? t('point.guest', { name }) : name}
        </span>
      ))}
    </p>
  );
}
