// A connection over which numbered deeds go out, and texts and pictures come back. Of pictures that come while one is being decoded only the newest is shown.
import { splitPicture } from '@/media/picture_message';

export interface PictureListener<Said, About> {
  said: (said: Said) => void;
  moment: (about: About, picture: ImageBitmap) => void;
  /** The connection ended, with the server's sentence or none. */
  lost: (sentence: string) => void;
}

export class PictureSocket<Said extends { failed?: string }, About> {
  private readonly socket: WebSocket;
  private left = false;
  private decoding = false;
  private next: ArrayBuffer | undefined;
  private failed = '';
  private last = 0;

  /** `first`: what is said as soon as it is open. */
  constructor(
    address: string,
    private readonly listener: PictureListener<Said, About>,
    first?: object,
  ) {
    this.socket = new WebSocket(`wss://${location.host}/api/${address}`);
    this.socket.binaryType = 'arraybuffer';
    if (first) this.socket.onopen = () => this.socket.send(JSON.stringify(first));
    this.socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (this.left) return;
      if (typeof event.data === 'string') this.hear(JSON.parse(event.data) as Said);
      else void this.show(event.data);
    };
    this.socket.onclose = (event) => {
      if (!this.left) listener.lost(this.failed || event.reason);
      this.left = true;
    };
  }

  /** The number that pictures name once they show it; 0 while nothing can be sent. */
  send(deed: object): number {
    if (this.left || this.socket.readyState !== WebSocket.OPEN) return 0;
    this.socket.send(JSON.stringify({ input: ++this.last, ...deed }));
    return this.last;
  }
  /** Nothing is told any more. */
  leave(): void {
    this.left = true;
    this.socket.close();
  }

  private hear(said: Said): void {
    this.listener.said(said);
    if (said.failed === undefined) return;
    this.failed = said.failed;
    this.socket.close();
  }
  private async show(message: ArrayBuffer): Promise<void> {
    this.next = message;
    if (this.decoding) return;
    this.decoding = true;
    try {
      while (this.next && !this.left) {
        const { about, jpeg } = splitPicture<About>(this.next);
        this.next = undefined;
        const picture = await createImageBitmap(jpeg);
        if (!this.left) this.listener.moment(about, picture);
        picture.close();
      }
    } finally {
      this.decoding = false;
    }
  }
}
