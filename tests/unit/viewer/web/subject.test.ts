import { describe, expect, it } from 'vitest';
import { patientText, procedureText, saidByTyping, staffText } from '@/subject/subject_text';

describe('A subject as text', () => {
  it('has what is known, and nothing for what is not', () => {
    const whole = {
      patient: 'Yamada Tarou',
      patient_id: '17',
      birth_date: '1980-01-15',
      sex: 'M',
      procedure: 'Cholecystectomy',
      staff: [{ role: 'surgeon', name: 'Sato' }, { role: 'observer', id: '9' }, { name: 'Mori' }],
    };
    expect(patientText(whole)).toBe('Yamada Tarou (17, born 1980-01-15, M)');
    expect(procedureText(whole)).toBe('Cholecystectomy');
    expect(staffText(whole)).toBe('Surgeon: Sato · observer: 9 · Mori');
    expect(patientText({ staff: [] })).toBe('');
    expect(patientText({ patient_id: '17', staff: [] })).toBe('17');
    expect(procedureText({ procedure_code: '5-511', staff: [] })).toBe('5-511');
  });
});

describe('What was typed', () => {
  const nothing = { patient: '', patient_id: ' ', birth_date: '', procedure: '', surgeon: '' };
  it('is the subject file’s form, without what was left empty', () => {
    expect(saidByTyping({ ...nothing, patient: ' Yamada ', procedure: 'Hernia', surgeon: 'Sato' })).toEqual({
      patient: { name: 'Yamada' },
      procedure: { description: 'Hernia' },
      staff: [{ role: 'surgeon', name: 'Sato' }],
    });
    expect(saidByTyping({ ...nothing, patient_id: '17', birth_date: '1980-01-15' })).toEqual({ patient: { id: '17', birth_date: '1980-01-15' } });
  });
  it('is nothing where nothing was typed', () => expect(saidByTyping(nothing)).toBeUndefined());
});
