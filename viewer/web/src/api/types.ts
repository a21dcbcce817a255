// What the server answers, by the names of /api/openapi.json: the build makes schema.d.ts of that document.
import type { components } from '@/api/schema';

type Schemas = components['schemas'];

export type Role = Schemas['Role'];
export type Verdict = Schemas['Verdict'];
export type Finding = Schemas['Finding'];
export type Severity = Finding['severity'];
/** Of a case or of the appliance log. */
export type Report = Schemas['Report'];
export type TimeProof = Report['time'];
export type VerificationReport = Schemas['Verification'];
export type VerifiedStream = Schemas['VerifiedStream'];
export type VerifiedBracket = Schemas['VerifiedBracket'];
export type VerifiedExcerpt = Schemas['VerifiedExcerpt'];
export type Verification = Schemas['Verifying'] | VerificationReport;

export type Session = Schemas['Session'];
export type Invitation = Schemas['Invitation'];
export type User = Schemas['User'];

export type CaseSummary = Schemas['CaseRow'];
export type SubjectState = NonNullable<CaseSummary['subject_state']>;
export type Subject = Schemas['Subject'];
export type CaseList = Schemas['CaseList'];
export type FleetCase = Schemas['FleetCase'];
export type FleetAppliance = Schemas['FleetAppliance'];
export type FleetConcern = Schemas['FleetConcern'];
export type FleetRoom = Schemas['FleetRoom'];
export type FleetRooms = Schemas['FleetRooms'];
export type CaseInfo = Schemas['Case'];
export type CaseConsents = Schemas['CaseConsents'];
export type StreamInfo = Schemas['Stream'];
export type LogEntry = Schemas['LogEntry'];

export type StartChoices = Schemas['StartChoices'];
export type ProcedureWay = Schemas['ProcedureWay'];
export type SaidOfCase = Schemas['SaidOfCase'];

export type Timeline = Schemas['Timeline'];
export type Segment = Timeline['segments'][number];
export type Gap = Timeline['gaps'][number];
export type Token = Timeline['tokens'][number];
export type TokenKind = Token['kind'];
export type Checkpoint = Timeline['checkpoints'][number];
export type TimelineBracket = Timeline['brackets'][number];
export type Mark = NonNullable<Timeline['marks']>[number];
export type Stroke = Schemas['Stroke'];
export type RecordedPoint = Schemas['RecordedPoint'];

export type Vitals = Schemas['Vitals'];
export type VitalSeries = Vitals['series'][number];
export type VitalBin = VitalSeries['bins'][number];
export type Alarm = Vitals['alarms'][number];
export type VitalNotice = Vitals['notices'][number];
export type VitalWords = Vitals['texts'][number];
export type LiveStream = Schemas['LiveStream'];
export type LiveVitals = Schemas['LiveVitals'];
export type LiveSeries = LiveVitals['series'][number];

export type ApplianceStatus = Schemas['ApplianceStatus'];
export type RoomStatus = Schemas['RoomStatus'];
export type StreamStatus = Schemas['StreamStatus'];
export type Profile = Schemas['ProfileChange']['profile'];
export type ProfileChanged = Schemas['ProfileChanged'];
export type AuthorityStatus = Schemas['AuthorityStatus'];

export type Judged = Schemas['Judged'];
export type Answer = Judged['verdict'];
export type Check = Judged['checks'][number];
export type Comparison = Schemas['ComparisonRow'];
export type ComparisonMaking = Schemas['ComparisonMaking'];
export type ComparisonDocument = Schemas['ComparisonDocument'];
export type OrganAlignment = NonNullable<ComparisonDocument['organ_alignment']>;
export type ComparedStep = ComparisonDocument['steps'][number];
export type Matching = Schemas['Matching'];
export type PlannedStep = Matching['steps'][number];
export type FoundStep = Matching['found'][number];
export type PickingView = Schemas['PickingView'];
export type PickingCamera = Schemas['PickingCamera'];
export type Preparing = Schemas['Preparing'];
export type JudgedPoints = Schemas['JudgedPoints'];
