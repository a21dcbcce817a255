// What each key does in the case view.
import { type MessageKey, t } from '@/i18n/i18n';
import { Dialog } from '@/shell/dialog';
import { kHelp } from '@/views/keyboard';

/** `streams`: the names of the case's, in the page's language. */
export function KeysDialog({ streams, onClose }: { streams: readonly string[]; onClose: () => void }) {
  return (
    <Dialog title={t('help.title')} onClose={onClose}>
      <dl class="keys">
        {kHelp.map(({ keys, does }) => (
          <div key={does}>
            <dt>
              {keys.map((key) => (
                <kbd key={key}>{key}</kbd>
              ))}
            </dt>
            <dd>{t(does as MessageKey)}</dd>
          </div>
        ))}
      </dl>
      <p class="muted">{t('help.mouse')}</p>
      <p class="muted">{t('help.streams', { names: streams.join(', ') })}</p>
    </Dialog>
  );
}
