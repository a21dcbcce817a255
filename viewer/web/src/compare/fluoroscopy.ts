// A case's fluoroscopy, and what a person says of it where the plan's radiographs shall be compared with it. Pure.
import type { CaseModel } from '@/views/case_model';

/** As a stream's `purpose` says it (viewer/compare/fluoroscopy.h). */
const kFluoroscopy = 'fluoroscopy';
export const fluoroscopies = (model: Pick<CaseModel, 'videos'>) => model.videos.filter((one) => one.purpose === kFluoroscopy);

export type Polarity = 'bone-black' | 'bone-white';

export interface Fluoroscopy {
  stream: string;
  /** How the fluoroscope sees the patient (docs/explanation/drr.md, "Geometry"), and the file it was read from. */
  geometry: Readonly<Record<string, unknown>>;
  file: string;
  /** The patient is moved until the pictures of this moment are most alike; nothing: they are not moved. */
  alignAt_ns: number | null;
  polarity: Polarity;
}

/** A file's text as a geometry; nothing where it is no JSON object. What the object must say is known to the program that compares, which refuses it by name. */
export function readGeometry(text: string): Readonly<Record<string, unknown>> | undefined {
  try {
    const read: unknown = JSON.parse(text);
    return typeof read === 'object' && read !== null && !Array.isArray(read) ? (read as Record<string, unknown>) : undefined;
  } catch {
    return undefined;
  }
}

export const fluoroscopyBody = (said: Fluoroscopy | undefined) =>
  said && { stream: said.stream, geometry: said.geometry, polarity: said.polarity, align_at_ns: said.alignAt_ns };
