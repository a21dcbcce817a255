// Pictures that come over a WebSocket with what belongs to them (viewer/http/picture_message.h).

/** The number of bytes of a JSON text (32 bits, the lowest first), the text, a JPEG file. */
export function splitPicture<T>(message: ArrayBuffer): { about: T; jpeg: Blob } {
  const size = new DataView(message).getUint32(0, true);
  const about = JSON.parse(new TextDecoder().decode(new Uint8Array(message, 4, size))) as T;
  return { about, jpeg: new Blob([new Uint8Array(message, 4 + size)], { type: 'image/jpeg' }) };
}
