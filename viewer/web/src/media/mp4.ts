// The codec string that Media Source Extensions ask for, from an initialisation segment (ISO/IEC 14496-15, AVCDecoderConfigurationRecord; RFC 6381).

/** "video/mp4; codecs=\"avc1.64001f\"". Throws if the segment holds no H.264. */
export function mimeTypeOf(init: Uint8Array): string {
  const name = [0x61, 0x76, 0x63, 0x43]; // avcC
  for (let at = 4; at + 8 <= init.length; ++at) {
    if (!name.every((byte, i) => init[at + i] === byte)) continue;
    // configurationVersion, AVCProfileIndication, profile_compatibility, AVCLevelIndication
    const hex = Array.from(init.subarray(at + 5, at + 8), (byte) => byte.toString(16).padStart(2, '0')).join('');
    return `video/mp4; codecs="avc1.${hex}"`;
  }
  throw new Error('the initialisation segment names no H.264 stream');
}
