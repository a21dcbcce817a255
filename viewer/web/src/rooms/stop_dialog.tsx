// Whether a case shall end, or the operation that goes on by itself after it: the one that ran when this was asked, and no other.
import { useSignal } from '@preact/signals';
import type { RoomStatus } from '@/api/types';
import { t } from '@/i18n/i18n';
import { canEnd, endsOperation } from '@/rooms/about_case';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';

interface Props {
  room: RoomStatus;
  /** Nobody says what the room does now. */
  unheard: boolean;
  /** The person wants case `id` ended, or the operation after it. */
  onStop: (id: string, ofOperation: boolean) => void;
  onClose: () => void;
}

export function StopDialog({ room, unheard, onStop, onClose }: Props) {
  const about = useSignal(room.case).value;
  const ofOperation = endsOperation(room);
  const stands = !unheard && room.case === about && canEnd(room);
  const changed = () => {
    if (unheard) return t('rooms.unheard');
    return room.case !== about && canEnd(room) ? t('rooms.otherRuns', { earlier: about, id: room.case }) : t('rooms.hasEnded', { id: about });
  };
  return (
    <Dialog title={t(ofOperation ? 'rooms.endTitle' : 'rooms.stopTitle', { room: room.room })} onClose={onClose}>
      {stands ? (
        <p>{t(ofOperation ? 'rooms.endWhat' : 'rooms.stopWhat')}</p>
      ) : (
        <p class="problem" role="alert">
          <Icon name="alarm" /> {changed()}
        </p>
      )}
      <div class="dialog-end">
        <button type="button" class="button button-danger" disabled={!stands} onClick={() => onStop(about, ofOperation)}>
          {t(ofOperation ? 'rooms.endOperation' : 'rooms.stop')}
        </button>
      </div>
    </Dialog>
  );
}
