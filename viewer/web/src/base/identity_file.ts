// An identity file as the API takes it: text as it is, one sealed with a passphrase, which is no text, in base64.

const kSealed = 'age-encryption.org/';

export function identityText(bytes: Uint8Array): string {
  const begins = String.fromCharCode(...bytes.subarray(0, kSealed.length));
  if (begins !== kSealed) return new TextDecoder().decode(bytes).trim();
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(''));
}

export async function readIdentityFile(file: File): Promise<string> {
  return identityText(new Uint8Array(await file.arrayBuffer()));
}
