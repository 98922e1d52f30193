#pragma once

#include <string>

/// The tables of a store, in one text for both databases. A type that they spell otherwise has a
/// word of its own: INTEGER is of 64 bits, BYTES are a text that may hold any byte.
namespace trammel {

extern const char* const kSchema;
extern const char* const kSchemaAdded;  ///< what version 2 added to version 1

/// Extra tables beside those of the schema version, so that older programs can still open the file.
/// They hold when jobs began, ended and with what outcome, when models were trained, and when their
/// newest measurement was taken (Unix time, s; NULL = not recorded). They also hold the batches in
/// quarantine that a job may train from; these are released if its model is put in force. Also
/// which jobs are checks of a robot's health, which look like diagnoses to programs that know none.
/// They hold how a version was judged when a person put it in force, and the changes that clients
/// asked for under an id, with what came of them; what of the rest has lost its text; which batches
/// nothing takes any more; and the store's identity. Which server works on a job, which start of it
/// (`token`), until when it is believed to live, and who wants the job to end. And of each cell the
/// highest number that a version was given: its row is what is locked where several servers write.
extern const char* const kTablesBeside;
/// Takes out what servers with stores of their own remembered of each other. Older programs make it
/// anew in a file.
extern const char* const kTablesGone;
extern const char* const kAuditTables;
extern const char* const kAuditServer;  ///< what was added to them: which server made the change
/// The column that was added to outcomes of jobs: why a person decides about the model (HeldBack).
extern const char* const kOutcomeHeldBack;
/// The column that was added to checks of a robot's health: the tolerance that was asked for, m.
extern const char* const kCheckTolerance;

/// The tables of a store that several servers share: who is there, by the starts of servers
/// (`token`), and how cells are described. The newest description of a cell is the one that the
/// record goes by.
extern const char* const kTablesOfServers;

[[nodiscard]] std::string in_sqlite(std::string tables);
[[nodiscard]] std::string in_postgres(std::string tables);

}  // namespace trammel
