// Whether a case shall end, or the operation that goes on by itself after it: the one that ran when this was asked, and no other.
import { useSignal } from '@preact/signals';
import type { RoomStatus } from '@/api/types';
import { t } from '@/i18n/i18n';
import { canEnd, isIdle } from '@/rooms/about_case';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';

interface Props {
  room: RoomStatus;
  /** The person wants case `id` ended, or the operation after it. */
  onStop: (id: string, endsOperation: boolean) => void;
  onClose: () => void;
}

export function StopDialog({ room, onStop, onClose }: Props) {
  const about = useSignal(room.case).value;
  const idle = isIdle(room);
  const stands = room.case === about && canEnd(room);
  return (
    <Dialog title={t(idle ? 'rooms.endTitle' : 'rooms.stopTitle', { room: room.room })} onClose={onClose}>
      {stands ? (
        <p>{t(idle ? 'rooms.endWhat' : 'rooms.stopWhat')}</p>
      ) : (
        <p class="problem" role="alert">
          <Icon name="alarm" />{' '}
          {room.case !== about && canEnd(room) ? t('rooms.otherRuns', { earlier: about, id: room.case }) : t('rooms.hasEnded', { id: about })}
        </p>
      )}
      <div class="dialog-end">
        <button type="button" class="button button-danger" disabled={!stands} onClick={() => onStop(about, idle)}>
          {t(idle ? 'rooms.endOperation' : 'rooms.stop')}
        </button>
      </div>
    </Dialog>
  );
}
