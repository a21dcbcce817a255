import { t } from '@/i18n/i18n';
import { isGone, tryNow } from '@/shell/connection';
import { Icon } from '@/shell/icon';

/** Above every view while the server does not answer. */
export function GoneBanner() {
  if (!isGone.value) return null;
  return (
    <div class="gone" role="alert">
      <Icon name="alarm" />
      <p>
        <strong>{t('gone.title')}</strong> {t('gone.what')}
      </p>
      <button type="button" class="button" onClick={tryNow}>
        {t('gone.now')}
      </button>
    </div>
  );
}
