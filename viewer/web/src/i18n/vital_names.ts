// Names of vital signs by their IEEE 11073 reference identifier. The server's own are English (media/vital_codes.cpp); a test compares the lists.
import { language } from '@/i18n/i18n';

export const kJapaneseVitals: Readonly<Record<string, string>> = {
  MDC_AWAY_CO2_ET: '呼気終末二酸化炭素',
  MDC_BLD_PERF_INDEX: '灌流指標',
  MDC_CO2_RESP_RATE: '呼吸数（二酸化炭素）',
  MDC_CONC_AWAY_CO2_ET: '呼気終末二酸化炭素濃度',
  MDC_CONC_AWAY_CO2_EXP: '呼気二酸化炭素',
  MDC_CONC_AWAY_CO2_INSP: '吸気二酸化炭素',
  MDC_ECG_ELEC_POTL_AVF: '心電図 aVF',
  MDC_ECG_ELEC_POTL_AVL: '心電図 aVL',
  MDC_ECG_ELEC_POTL_AVR: '心電図 aVR',
  MDC_ECG_ELEC_POTL_I: '心電図 I',
  MDC_ECG_ELEC_POTL_II: '心電図 II',
  MDC_ECG_ELEC_POTL_III: '心電図 III',
  MDC_ECG_ELEC_POTL_V1: '心電図 V1',
  MDC_ECG_ELEC_POTL_V2: '心電図 V2',
  MDC_ECG_ELEC_POTL_V3: '心電図 V3',
  MDC_ECG_ELEC_POTL_V4: '心電図 V4',
  MDC_ECG_ELEC_POTL_V5: '心電図 V5',
  MDC_ECG_ELEC_POTL_V6: '心電図 V6',
  MDC_ECG_HEART_RATE: '心拍数',
  MDC_FLOW_AWAY: '気道流量',
  MDC_PRESS_AWAY: '気道内圧',
  MDC_PRESS_BLD_ART: '動脈圧（部位不明）',
  MDC_PRESS_BLD_ART_ABP: '動脈圧',
  MDC_PRESS_BLD_ART_ABP_DIA: '動脈圧（拡張期）',
  MDC_PRESS_BLD_ART_ABP_MEAN: '動脈圧（平均）',
  MDC_PRESS_BLD_ART_ABP_SYS: '動脈圧（収縮期）',
  MDC_PRESS_BLD_ART_DIA: '動脈圧（部位不明、拡張期）',
  MDC_PRESS_BLD_ART_MEAN: '動脈圧（部位不明、平均）',
  MDC_PRESS_BLD_ART_PULM: '肺動脈圧',
  MDC_PRESS_BLD_ART_PULM_DIA: '肺動脈圧（拡張期）',
  MDC_PRESS_BLD_ART_PULM_MEAN: '肺動脈圧（平均）',
  MDC_PRESS_BLD_ART_PULM_SYS: '肺動脈圧（収縮期）',
  MDC_PRESS_BLD_ART_SYS: '動脈圧（部位不明、収縮期）',
  MDC_PRESS_BLD_NONINV_DIA: '非観血血圧（拡張期）',
  MDC_PRESS_BLD_NONINV_MEAN: '非観血血圧（平均）',
  MDC_PRESS_BLD_NONINV_SYS: '非観血血圧（収縮期）',
  MDC_PRESS_BLD_VEN_CENT: '中心静脈圧',
  MDC_PRESS_BLD_VEN_CENT_MEAN: '中心静脈圧（平均）',
  MDC_PRESS_CUFF_DIA: 'カフ圧（拡張期）',
  MDC_PRESS_CUFF_MEAN: 'カフ圧（平均）',
  MDC_PRESS_CUFF_SYS: 'カフ圧（収縮期）',
  MDC_PULS_OXIM_PLETH: '脈波',
  MDC_PULS_OXIM_PULS_RATE: '脈拍数',
  MDC_PULS_OXIM_SAT_O2: '酸素飽和度',
  MDC_PULS_RATE_NON_INV: '脈拍数（非観血）',
  MDC_RESP: '呼吸',
  MDC_RESP_RATE: '呼吸数',
  MDC_TEMP: '体温',
  MDC_TEMP_AXIL: '腋窩温',
  MDC_TEMP_BODY: '体温',
  MDC_TEMP_CORE: '中枢温',
  MDC_TEMP_ESOPH: '食道温',
  MDC_TEMP_RECT: '直腸温',
  MDC_TEMP_SKIN: '皮膚温',
  MDC_TTHOR_RESP_RATE: '呼吸数（経胸郭）',
  MDC_VOL_AWAY_TIDAL: '一回換気量',
};

/** In the page's language; `label`, the server's, where it knows no other. */
export const vitalName = (code: string, label: string): string => (language.value === 'ja' ? kJapaneseVitals[code] : undefined) ?? label;

const kPressures: Readonly<Record<string, string>> = { systolic: '収縮期血圧', diastolic: '拡張期血圧', mean: '平均血圧' };

/** A pressure that passed a limit, which the comparison says in English; alarms are in their monitor's own words. */
export function pressureText(text: string): string {
  const limit = /^(systolic|diastolic|mean) pressure ([\d.]+) mmHg, (already )?(below|above) ([\d.]+)$/.exec(text);
  if (language.value !== 'ja' || !limit) return text;
  const [, which, value, already, side, bound] = limit;
  return `${kPressures[which as string]} ${value} mmHg（${bound} ${side === 'below' ? '未満' : '超'}${already ? '、開始時から' : ''}）`;
}
