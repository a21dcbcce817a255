// Every code a finding can have, with its severity and what it means: the one table
// (docs/reference/format.md, "Findings"). A code's severity never depends on circumstances; where
// circumstances matter there are two codes. Codes are stable: programs and reports rely on them.
//
// The verdict is the gravest severity found: tampered > incomplete > unproven > gap > note.
#pragma once

#include <array>
#include <string_view>

#include "archive/verify/finding.h"

namespace kiroku::archive {

struct FindingCode {
  std::string_view name;
  Severity severity;
  std::string_view meaning;
};

inline constexpr auto kFindingCodes = std::to_array<FindingCode>({
    // -- ledger: its lines
    {"entry-malformed", Severity::kTampered,
     "a line is no entry of the format; offset: the byte where it goes wrong"},
    {"entry-too-long", Severity::kTampered, "a line is longer than 1 MiB"},
    {"ledger-unreadable", Severity::kTampered,
     "more than 10,000 lines are no entries: the rest of the ledger was not read, and nothing was judged "
     "that "
     "depends on it"},
    {"entry-out-of-sequence", Severity::kTampered, "seq is not the number of the line"},
    {"entry-after-close", Severity::kTampered,
     "something other than token, token-missed and erased follows close"},
    {"entry-after-recovered", Severity::kTampered,
     "a counted segment, a mark or a clock entry follows recovered, which no recorder writes: a case that "
     "was cut "
     "off is only closed"},
    {"erased-before-close", Severity::kTampered,
     "segments are entered as erased before close, which no recorder does; it excuses nothing"},
    {"open-missing", Severity::kTampered, "the first entry is not open (of a log: boot)"},
    {"open-repeated", Severity::kTampered, "open stands again later"},
    {"device-invalid", Severity::kTampered, "the device of open is no verifier key"},
    {"clock-went-back", Severity::kTampered, "the case clock (mono_ns) is less than in the entry before"},
    {"ledger-changed", Severity::kTampered,
     "a checkpoint's root is not the tree's: lines since the last one that fits were changed, added or "
     "removed"},
    {"ledger-cut", Severity::kTampered, "a checkpoint covers more entries than there are"},
    {"ledger-not-covered", Severity::kTampered,
     "the case is closed, and no checkpoint covers its last entries"},
    {"ledger-end-damaged", Severity::kTampered, "a checkpoint covers the last line, which is not whole"},
    {"ledger-torn", Severity::kIncomplete,
     "the last line was not written to its end, and no checkpoint covers it"},
    {"not-closed", Severity::kIncomplete, "there is no close: still being recorded, or never closed"},
    {"close-not-covered", Severity::kIncomplete, "no checkpoint covers close: the case was not finished"},
    {"token-not-covered", Severity::kIncomplete,
     "behind the last checkpoint there are only entries of tokens, which state what those say: the case was "
     "not finished"},
    {"end-not-covered", Severity::kIncomplete,
     "the same, with entries of missed tokens or erasures among them, which excuse nothing: the case is "
     "being "
     "brought to its end, or was not finished"},
    {"recovered", Severity::kGap, "recording was cut off by power loss or a crash and found again"},
    {"clock-stepped", Severity::kNote, "the machine's wall clock was set"},
    {"clock-slewed", Severity::kNote,
     "the machine's clocks, the case clock among them, were made to run more than 200 ppm faster or slower"},
    {"clock-slews-allowed-for", Severity::kNote,
     "the slews that the ledger states may have moved the case clock by 1 s or more in all: by so much the "
     "authorities' times may differ from it without a finding"},
    {"clock-not-synchronised", Severity::kNote, "the machine's wall clock was not synchronised"},
    {"clock-differs", Severity::kNote,
     "the recorder's wall clock, and with it every time that it states, differs from an outside authority's "
     "by "
     "more than a minute"},
    {"utc-went-back", Severity::kNote,
     "the machine's UTC is earlier than in the entry before, and no clock entry says why"},
    {"close-utc-differs", Severity::kNote,
     "the UTC of close is more than a minute away from where that of open, the case clock and the stated "
     "steps "
     "of the wall clock lead: how long the case lasted says the case clock, not these two times"},
    {"folder-name-differs", Severity::kNote, "the folder is not called by its case identifier"},
    {"folder-of-another-case", Severity::kUnproven,
     "the folder is called by the identifier of another case than the one that lies in it"},
    // -- checkpoints
    {"checkpoint-malformed", Severity::kTampered, "a note is no signed checkpoint"},
    {"checkpoint-unknown-key", Severity::kTampered, "a checkpoint is not signed by the case's device"},
    {"checkpoint-signature-invalid", Severity::kTampered,
     "the device's signature on a checkpoint does not verify"},
    {"checkpoint-ml-dsa-missing", Severity::kTampered,
     "the device signs with an ML-DSA key, too, by the identity given, and a checkpoint from since then has "
     "no "
     "such signature: it was taken away, or made by somebody else"},
    {"device-ml-dsa-differs", Severity::kTampered,
     "the log states another ML-DSA key of the device than the identity given"},
    {"checkpoint-not-by-both", Severity::kUnproven,
     "the device signs with an ML-DSA key, too, by the identity given, and nothing that it signed so covers "
     "what is here: it may be from before, or by whoever can forge Ed25519"},
    {"checkpoint-ml-dsa-unchecked", Severity::kNote,
     "checkpoints carry a signature in the name of the device's ML-DSA key, which was not given: Ed25519 "
     "alone "
     "was checked"},
    {"device-hardware-differs", Severity::kTampered,
     "the log states another key in the device's hardware than the identity given"},
    {"checkpoint-not-by-hardware", Severity::kUnproven,
     "the device has a key that its hardware does not give away, by the identity given, and no signature by "
     "it "
     "covers what is here: the hardware did not answer, or somebody with a copy of the other keys made this"},
    {"checkpoint-hardware-missing", Severity::kNote,
     "the device's hardware did not sign some checkpoints; one that it signed later covers their entries"},
    {"checkpoint-hardware-unchecked", Severity::kNote,
     "checkpoints carry a signature in the name of the key in the device's hardware, which was not given: it "
     "was not checked"},
    {"checkpoint-of-other-origin", Severity::kTampered, "a checkpoint is of another case or log"},
    {"checkpoint-size-differs", Severity::kTampered, "a checkpoint states another size than its file name"},
    {"checkpoint-missing", Severity::kTampered, "a token is over a checkpoint that is not there"},
    {"device-not-trusted", Severity::kUnproven, "the device's key is not among the trusted ones"},
    {"no-trusted-device", Severity::kUnproven, "no trusted device key was given"},
    {"device-file-differs", Severity::kNote, "device.pub is missing or not the key that open names"},
    {"checkpoint-cosigned", Severity::kNote,
     "a checkpoint carries signatures by keys that were not given; they were not checked"},
    // -- tokens
    {"token-name-differs", Severity::kTampered,
     "a token's file is not named by its checkpoint and authority"},
    {"token-covers-later", Severity::kTampered,
     "a token entry names a checkpoint larger than the ledger was then"},
    {"token-repeated", Severity::kTampered, "one token is entered twice"},
    {"token-imprint-differs", Severity::kTampered, "a token is not over the checkpoint it is entered for"},
    {"token-refused", Severity::kTampered,
     "a token does not hold (signature, signer, certificate at its time, form)"},
    {"token-entry-differs", Severity::kTampered,
     "gen_time, accuracy_ns or serial of an entry is not its token's"},
    {"token-exchange-impossible", Severity::kTampered,
     "asked_ns and answered_ns of an entry are not between its checkpoint and itself"},
    {"token-order", Severity::kUnproven,
     "a token of an outside authority covers the entry of an earlier one of its own that states a later "
     "time, "
     "by more than 2 s or where it states that its tokens are in order: its clock was set back"},
    {"authorities-disagree", Severity::kUnproven,
     "a token of an outside authority covers the entry of another's that states a time more than 2 s later, "
     "or "
     "the time between two of theirs differs from the case clock as that of authority-clock-differs: one of "
     "these clocks is wrong"},
    {"clock-contradicted", Severity::kTampered,
     "time between two trusted outside tokens differs from the case clock by more than accuracies, round "
     "trips, stated slews, 2 s and 0.05 %, and so, over the same time and the same way, does that of another "
     "outside authority"},
    {"authority-clock-differs", Severity::kUnproven,
     "the same of one outside authority alone, or of several where a step or a slew may explain it: a clock "
     "was set, or the case clock is made up"},
    {"end-stamped-late", Severity::kNote,
     "the first token over the end is more than 2 s later than the case clock of close explains, whatever "
     "the "
     "ledger states of it: whether recording ended at close rests on the recorder's word"},
    {"stamped-after-close", Severity::kNote,
     "no token of an outside authority is over anything before close, or, of an excerpt, entered before its "
     "last segment: when it was recorded, and for how long, rests on the recorder's word"},
    {"first-stamped-late", Severity::kNote,
     "the first token of an outside authority is entered more than two minutes, by the case clock, behind "
     "the beginning of what was recorded: that this is no older rests on the recorder's word"},
    {"segments-entered-late", Severity::kNote,
     "a segment that is of no marks is entered behind an outside token that was entered more than two "
     "minutes, by the "
     "case clock, after the segment ends: that it is no older rests on the recorder's word"},
    {"authority-clock-set", Severity::kNote,
     "the same of one outside authority, while another one's clock went on as the case clock did, and not as "
     "that one's"},
    {"clock-disagreement", Severity::kUnproven,
     "the same between tokens that are self-issued or not trusted, where no stated step of the wall clock "
     "explains it: it was probably set"},
    {"token-untrusted", Severity::kUnproven,
     "a token could not be judged under the trusted roots, and no other over the same checkpoint could"},
    {"no-trusted-authority", Severity::kUnproven, "there are tokens, and no trusted root was given"},
    {"no-token", Severity::kUnproven, "there is no token: nothing outside the device says when"},
    {"end-not-stamped", Severity::kUnproven,
     "there are tokens, none covers close, and no token-missed says why"},
    {"token-missed", Severity::kGap, "an authority did not answer, or not with a valid token"},
    {"second-token-untrusted", Severity::kNote,
     "a token could not be judged under the trusted roots; another over the same checkpoint is valid"},
    // -- streams
    {"stream-unknown", Severity::kTampered, "an entry names a stream that open does not"},
    {"stream-form-unknown", Severity::kTampered,
     "open names a stream of a kind, media and profile that the format does not have together"},
    {"segment-name-differs", Severity::kTampered, "a segment's file is not named by its stream and index"},
    {"segment-out-of-order", Severity::kTampered, "a segment's index is not the next of its stream"},
    {"segment-overlap", Severity::kTampered, "a segment begins before the one before it ends"},
    {"segment-times-differ", Severity::kTampered,
     "a segment is stated to be stamped in another order, unit or time than any recorder stamps it"},
    {"segment-times-late", Severity::kUnproven,
     "by the time stamps that are stated, pictures of a stream lie otherwise on the case clock than by the "
     "times that are stated, beyond what a burst of pictures explains"},
    {"segment-hole", Severity::kTampered,
     "time between two segments of a stream that no gap accounts for, in one piece or in many seams"},
    {"stream-for-nobody", Severity::kUnproven,
     "open names no age recipient of a stream: whatever is in it, nobody is said to be able to open it"},
    {"no-stream", Severity::kUnproven,
     "open names no stream but of marks: nothing of an operation was recorded, and nothing says why"},
    {"stream-empty", Severity::kUnproven, "a stream holds nothing in the whole case, and no gap says why"},
    {"stream-begins-late", Severity::kUnproven,
     "a stream that is recorded as it comes holds nothing for more than 2 s at the case's beginning, and no "
     "gap says why"},
    {"stream-ends-early", Severity::kUnproven,
     "a stream that is recorded as it comes holds nothing for more than 10 s before close, and no gap says "
     "why"},
    {"gap-beyond-end", Severity::kUnproven,
     "a gap is stated to end more than 2 s after both close and the last segment of its stream"},
    {"erased-never-recorded", Severity::kTampered,
     "segments are stated to be erased that the ledger never had"},
    {"segment-in-future", Severity::kUnproven,
     "a segment of a stream that is recorded as it comes ends more than 2 s after its entry was written, or, "
     "found by recovery, is longer than the time between the outside time-stamps around it"},
    {"segment-too-long", Severity::kUnproven,
     "a segment of a stream that is recorded as it comes, or one that recovery found, lasts more than 11 s, "
     "which no recorder writes"},
    {"segment-not-sealed", Severity::kUnproven,
     "a segment that is said to be complete, or to hold frames or samples, is no age file with as much in "
     "it: "
     "no key can open it"},
    {"segments-found-many", Severity::kUnproven,
     "recovery is said to have found more than 64 segments of a stream that is recorded as it comes, more "
     "than "
     "a recorder that dies leaves"},
    {"subject-not-sealed", Severity::kUnproven,
     "what a case has of the patient is no age file with anything in it: anybody can read it, or nobody"},
    {"segments-empty", Severity::kUnproven,
     "segments of pictures hold no frame for more than 5 s, one after the other, or no frame in all that is "
     "there, and no gap says why"},
    {"segment-cut-unexplained", Severity::kTampered,
     "an incomplete segment without recovered, gap or close between it and its neighbours"},
    {"segment-uncounted-unexplained", Severity::kTampered,
     "an entry states no counts of its segment, and no recovered stands before it"},
    {"totals-differ", Severity::kTampered,
     "close states other totals than the segments add up to, of an excerpt less than its lines show"},
    {"event-missing", Severity::kUnproven,
     "a mark entry commits to an event that no sealed events segment holds, although those that must hold it "
     "open"},
    {"event-not-committed", Severity::kUnproven,
     "a sealed events segment holds a line to which no mark entry commits, or more often than entries do"},
    {"event-time-differs", Severity::kNote,
     "an event states a time that is more than 5 s before its mark entry was written, or after it, or "
     "another "
     "UTC"},
    {"events-not-compared", Severity::kNote,
     "events and mark entries that were not compared: what would show their others is not there whole, or "
     "was not opened"},
    {"segment-undecryptable", Severity::kTampered, "a segment with the right hash does not decrypt"},
    {"segment-not-for-recipient", Severity::kTampered,
     "open names a recipient of the stream, whose identity was given and does not open a segment of it"},
    {"segment-undecodable", Severity::kTampered, "a segment does not decode to what its entry states"},
    {"subject-undecryptable", Severity::kTampered, "the subject with the right hash does not decrypt"},
    {"subject-undecodable", Severity::kUnproven, "the subject opens, and is no JSON object"},
    {"gap", Severity::kGap, "time in which nothing could be recorded"},
    {"sound-gap", Severity::kGap, "time in which the sound beside pictures could not be recorded"},
    {"segment-incomplete", Severity::kGap, "a segment was cut off before its end"},
    {"segment-part-lost", Severity::kGap,
     "of a segment that recovery found, what had not reached the disk does not decrypt; offset: from where "
     "on"},
    {"segment-uncounted", Severity::kGap,
     "a segment that recovery found: its times are estimates, its frames are not counted"},
    {"segments-erased", Severity::kGap, "segments were removed by retention"},
    {"frames-dropped", Severity::kGap, "frames of a stream were dropped"},
    {"segments-sparse", Severity::kNote,
     "segments hold far fewer frames than is usual in their stream, or than one a second, or none of a "
     "monitor's holds a sample"},
    {"segment-within-gap", Severity::kNote,
     "segments with pictures lie in time that a gap of their stream says was not recorded"},
    {"monitor-silent", Severity::kNote,
     "a monitor's segments hold no sample for more than a minute; nobody states that as a gap"},
    {"stream-shorter", Severity::kNote,
     "a stream that is stated to be read from a file is shorter than the case, by more than 2 s at the "
     "beginning "
     "or 10 s at the end"},
    {"segment-not-decrypted", Severity::kNote, "the identities given are no recipients of a stream"},
    {"subject-not-decrypted", Severity::kNote, "the identities given are no recipients of the subject"},
    {"erased-file-present", Severity::kNote, "a segment entered as erased is still there"},
    // -- files
    {"file-missing", Severity::kTampered, "a file that the ledger names is not there"},
    {"file-size-differs", Severity::kTampered, "a file has not the size the ledger states"},
    {"file-too-large", Severity::kTampered,
     "a segment or the subject has more than 1 GiB, and so has its entry; it was not read"},
    {"file-has-hole", Severity::kTampered,
     "a sealed file has a hole, which takes no room on the disk and which no recorder leaves; it was not "
     "read; "
     "offset: where the hole begins"},
    {"file-hash-differs", Severity::kTampered,
     "a file has not the hash the ledger states; offset, with an identity: the first chunk that does not "
     "decrypt, or that changed while it was checked"},
    {"file-unnamed", Severity::kTampered, "a file or folder that nothing names"},
    {"file-of-a-system", Severity::kNote,
     "a file that nothing names and that operating systems leave behind by themselves, by its name: nobody "
     "recorded it"},
    {"file-not-regular", Severity::kTampered,
     "a symbolic link, a special file or a second name of another file"},
    {"name-clash", Severity::kTampered, "two names differ only in case"},
    {"file-unreadable", Severity::kUnproven, "a file cannot be read by this user or from this disk"},
    {"authority-file-malformed", Severity::kNote,
     "a file of authorities/ is not certificates and nothing else; nothing was checked with it"},
    {"authority-not-named", Severity::kNote,
     "authorities/ has certificates of an authority that no entry names (yet)"},
    {"part-file", Severity::kNote, "a file that was being written when recording stopped, or is now"},
    {"token-not-entered", Severity::kNote,
     "a token whose entry is not written yet, or was not when recording stopped"},
    {"segment-not-entered", Severity::kNote,
     "a segment whose entry is not written yet, or whose flush failed"},
    // -- the appliance log; beside a case Finding::of_log
    {"log-case-unknown", Severity::kTampered,
     "the log has no case-opened for this case, and signed entries go on by more than 64 from the state over "
     "which it was opened"},
    {"log-case-not-entered", Severity::kIncomplete,
     "the same of a case of one entry that no checkpoint covers: it was being begun"},
    {"log-opening-differs", Severity::kTampered,
     "the log knows another entry 0; if it was another device's then, that one is trusted and the case's is "
     "not"},
    {"log-checkpoint-differs", Severity::kTampered, "the log knows another root at some size of this case"},
    {"log-knows-more", Severity::kTampered,
     "the log knows entries of this case that are not there: the end was removed"},
    {"log-end-differs", Severity::kTampered, "the log states another final token than the case has"},
    {"log-entry-doubted", Severity::kUnproven,
     "an entry of the log that nobody signed before another followed contradicts the case, or tells of one "
     "that "
     "is not there: the machine stopped at that moment, or somebody made it up"},
    {"log-head-differs", Severity::kTampered, "the case was opened over another state of the log"},
    {"case-missing", Severity::kTampered,
     "the log knows a case that is not in the archive and was not erased; what begins with another line, or "
     "is "
     "an excerpt, is not the case"},
    {"log-silent", Severity::kUnproven,
     "the log says nothing of the case that could be checked: what known devices signed of it hardly goes "
     "beyond the state over which the case was opened, or its lines are not sound"},
    {"log-not-sound", Severity::kUnproven,
     "beside a case: lines of the log are not as they were signed, lack, or say what no recorder enters; "
     "what "
     "the "
     "broken ones said of the case was not checked"},
    {"log-not-tidy", Severity::kNote,
     "beside a case: something is wrong in the log's folder that hides no line of the log: a name, or a "
     "checkpoint that does not hold"},
    {"cases-not-looked-for", Severity::kNote,
     "the log was verified alone: whether the cases that it knows are still there was not checked"},
    {"log-signed-late", Severity::kUnproven,
     "several entries of the log were followed by one checkpoint, where each was to have its own: nobody "
     "signed "
     "them when they were written"},
    {"log-tail-unsigned", Severity::kUnproven,
     "no checkpoint covers the log, or several of its newest entries: nobody signed them"},
    {"log-tail-not-covered", Severity::kNote, "no checkpoint covers the newest entries of the log"},
    {"log-damage-stated", Severity::kTampered,
     "the log says itself that lines of it were changed after they were signed"},
    {"log-damage-refuted", Severity::kNote,
     "the log says itself that lines of it were changed, and the device's checkpoint over them holds: "
     "somebody "
     "added that entry"},
    {"log-case-open", Severity::kNote, "the log knows no end of a case"},
    {"log-case-erased", Severity::kNote,
     "the log says that the whole case was erased, and here it is: a copy that was kept, or an erasure that "
     "did "
     "not come about"},
    {"device-attestation-differs", Severity::kTampered,
     "the log states a second attestation key, which no recorder does"},
    {"boot-quote-malformed", Severity::kTampered,
     "what the log has as a quote of the boot by the TPM is none that a TPM makes"},
    {"boot-quote-signature-invalid", Severity::kTampered,
     "a quote of the boot is not signed by the attestation key that the log states"},
    {"boot-quote-of-elsewhere", Severity::kTampered,
     "a quote of the boot was made for another entry, another boot or another log"},
    {"boot-pcrs-differ", Severity::kTampered,
     "the log states other registers of the boot than the TPM quoted"},
    {"boot-clock-went-back", Severity::kTampered,
     "by the TPM's count of resets and its clock, a quote of the boot is older than the one before it"},
    {"boot-quote-missing", Severity::kUnproven,
     "the log states an attestation key, and a later boot has neither a quote nor a word why"},
    {"boot-not-quoted", Severity::kNote,
     "the TPM did not quote some boots; the log says why: of such a boot nothing is known"},
    {"measured-boot-changed", Severity::kNote,
     "the measured boot is another than the last one that was quoted: an update does that, and so does "
     "whoever starts other software"},
    {"boots-not-entered", Severity::kNote,
     "by the TPM's count of resets the machine was started more often than the log tells of"},
    {"boot-not-measured", Severity::kNote,
     "registers into which every firmware measures were not quoted, or hold nothing: such a quote says "
     "nothing of what the machine started"},
    {"boot-without-reset", Severity::kNote,
     "the log tells of another boot, and by the TPM's counts the machine was not started anew: the running "
     "kernel started another one, or somebody made the boot up"},
    {"boot-quotes-hold", Severity::kNote,
     "the TPM quoted the measured boot, by the attestation key that the log states: nobody checks here that "
     "this is the key of a TPM"},
    {"erased-while-held", Severity::kGap,
     "the log says that something of a case was erased while a legal hold of it stood"},
    {"consent-given-twice", Severity::kGap,
     "the log states a consent of a case to a purpose to which one stood already"},
    {"consent-not-given", Severity::kGap,
     "the log states that a consent was withdrawn which did not stand: it was never given, or withdrawn "
     "before"},
    {"consent-case-unknown", Severity::kGap,
     "the log states a consent or its withdrawal for a case that it does not say was opened before"},
    {"consent-doubted", Severity::kGap,
     "nobody signed an entry of a consent before another followed: the machine stopped at that moment, or "
     "somebody made it up. A consent then counts for nothing; a withdrawal forbids the use and erases "
     "nothing"},
    {"access-without-consent", Severity::kGap,
     "the log says that a case was used for a purpose to which no consent stood"},
    {"consent-file-missing", Severity::kGap,
     "a sealed statement of consent, or a form, is not there: it was removed, or this is a copy without"},
    {"consent-not-sealed", Severity::kUnproven,
     "a statement of consent, or a form, is no age file with anything in it: anybody can read it, or nobody"},
    {"consent-not-entered", Severity::kGap,
     "a sealed statement of consent, or a form, that no entry names: the machine stopped before it was "
     "entered, or its entry was removed"},
    {"log-of-another-device", Severity::kUnproven,
     "the log is another device's, or is while it tells of the case: what stands there then counts neither "
     "for "
     "the case nor against it"},
    {"log-algorithm-ended", Severity::kNote,
     "by the policy given, an algorithm on which the appliance log rests counts no more: that it knows the "
     "same "
     "of the case proves nothing"},
    {"log-doubted", Severity::kUnproven,
     "the appliance log speaks against the case, and by the policy given an algorithm on which the log rests "
     "counts no more: anybody can have written it since"},
    // -- checkpoints kept outside (--against)
    {"outside-note-rolled-back", Severity::kTampered,
     "a note kept outside was signed of more entries than there are: the end was removed"},
    {"outside-note-forked", Severity::kTampered,
     "a note kept outside was signed of other entries: what is shown is not the history that the device "
     "signed"},
    {"outside-notes-contradict", Severity::kTampered,
     "two notes kept outside, signed by one key, have one origin and size and different roots: the device "
     "signed two histories"},
    {"outside-note-not-by-both", Severity::kUnproven,
     "a note given does not fit, and lacks the signature by a key that the device has beside Ed25519: "
     "whoever "
     "has or can forge the other could have made it"},
    {"outside-note-invalid", Severity::kUnproven,
     "a note given is no signed checkpoint, or its signature does not verify: it was not compared"},
    {"outside-note-untrusted", Severity::kUnproven,
     "a note given is not signed by a trusted device for its own log or case: it was not compared"},
    {"outside-note-of-other-origin", Severity::kUnproven,
     "a note given is of another case or log, or of another device of this name: it was not compared"},
    {"outside-note-unchecked", Severity::kUnproven,
     "what is here does not show the root at a given note's size: it was not compared"},
    {"outside-note-holds", Severity::kNote,
     "a note kept outside fits: the entries begin with those that it was signed of"},
    // -- a proof from the log
    {"log-proof-differs", Severity::kTampered,
     "by a proof from the log, which a trusted device signed, the case ended otherwise"},
    {"log-proof-not-used", Severity::kUnproven,
     "a proof from the log that was given does not hold, is of another device's log, or shows nothing of "
     "what is here"},
    {"log-proof-holds", Severity::kNote,
     "a proof from the log holds: the case ended as the device entered it there"},
    // -- two cases of one operation
    {"carrying-on-broken", Severity::kTampered,
     "this case and the one that it carries on, or that carries it on, do not fit each other"},
    {"carried-on-not-here", Severity::kNote,
     "the case that this one carries on, or that carries this one on, does not lie beside it"},
    {"carried-on-not-compared", Severity::kNote,
     "something else lies in the place of that case, or less of it, or what its device did not sign: they "
     "were "
     "not compared"},
    {"carrying-on-holds", Severity::kNote,
     "this case and the one that it carries on, or that carries it on, name each other"},
    // -- excerpts
    {"excerpt-malformed", Severity::kTampered,
     "excerpt.json is not of the format, or does not fit the lines beside it"},
    {"excerpt-empty", Severity::kTampered,
     "no segment of the selected streams lies in the time that the excerpt states: it is of nothing"},
    {"excerpt-outside-case", Severity::kTampered,
     "the time that the excerpt states begins before the case, or after all that its lines show"},
    {"excerpt-proof-invalid", Severity::kTampered, "a Merkle proof does not lead to the signed root"},
    {"excerpt-range-short", Severity::kUnproven,
     "the lines do not show every segment that a selected stream has in the time the excerpt states, or why "
     "it has none"},
    {"excerpt-no-later-token", Severity::kUnproven, "no token after the excerpt's last segment is in it"},
    {"rekeyed-key-differs", Severity::kTampered,
     "a segment's new header yields another key than its original one"},
    {"rekeyed-not-opened", Severity::kUnproven,
     "a segment was re-keyed, and only a recipient's identity can prove that it still opens to the same "
     "film"},
    // -- evidence records
    {"evidence-holds", Severity::kNote,
     "the case's evidence record holds: since when, and by how many time-stamps"},
    {"evidence-refused", Severity::kNote,
     "an evidence record lies beside the case and proves nothing of it: it is another's, was cut, renewed "
     "too late, or "
     "is no record"},
    {"evidence-not-checked", Severity::kNote,
     "an evidence record lies beside the case and could not be judged: a trusted root is missing, it lapsed, "
     "or "
     "something could not be read"},
    {"evidence-asked-for", Severity::kUnproven,
     "the evidence record that was given does not hold for this case, or that could not be checked"},
    {"algorithm-ended", Severity::kUnproven,
     "by the policy given, an algorithm on which the case rests counts no more, and no evidence record of "
     "outside "
     "authorities holds that began before"},
    // -- what other devices state of a case that a store had without its end
    {"store-statement-holds", Severity::kNote,
     "another device, which is trusted, states how far a store had the case, and when it looked: what is "
     "here "
     "begins with just that"},
    {"store-statement-outgrown", Severity::kNote,
     "entries or files came to the case since another device stated what the store had of it"},
    {"store-statement-differs", Severity::kUnproven,
     "another device, which is trusted, states that a store had something of the case that is not here, or "
     "is "
     "another"},
    {"store-statement-untrusted", Severity::kNote,
     "a statement of what a store had of the case lies beside it, and no device that is trusted signed it: "
     "anybody can write one"},
    {"store-statement-refused", Severity::kNote,
     "what lies beside the case as such a statement is none, is of another case, is not signed as it must "
     "be, "
     "or cannot be read"},
    // -- of the format
    {"format-newer", Severity::kUnproven,
     "the case or the excerpt is of a later version of the format than this program knows: what its entries "
     "say, and its files, was not checked"},
    // -- of the list itself
    {"more-findings", Severity::kNote,
     "so many findings, of one code or of all together, that the rest is only counted"},
});

/// A code of the table; any other text does not compile.
class CodeName {
 public:
  // NOLINTNEXTLINE(google-explicit-constructor,hicpp-explicit-conversions): so that a literal is checked
  // where it stands
  consteval CodeName(const char* name) : index_(find(name)) {}
  [[nodiscard]] constexpr const FindingCode& code() const { return kFindingCodes[index_]; }
  /// Its place in the table.
  [[nodiscard]] constexpr std::size_t index() const { return index_; }

 private:
  static consteval std::size_t find(std::string_view name) {
    std::size_t index = 0;
    while (kFindingCodes.at(index).name != name) {
      ++index;  // at() ends the compilation for a name that is not in the table
    }
    return index;
  }

  std::size_t index_;
};

}  // namespace kiroku::archive
