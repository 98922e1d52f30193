#pragma once

#include <string>

/// The tables of a store, in one text for both databases. A type whose spelling differs has a word
/// of its own: INTEGER has 64 bits, BYTES is a text of arbitrary bytes.
namespace trammel {

extern const char* const kSchema;
extern const char* const kSchemaAdded;  ///< the tables that version 2 added to version 1

/// Extra tables beside those of the schema version, so that older programs can still open the file.
/// They hold: the start, the end and the outcome of jobs; the training time of models and the time
/// of their newest measurement (Unix time, s; NULL = not recorded); the batches in quarantine that
/// a job may train from, which are released when its model is put in force; the jobs that are
/// health checks, which older programs take for diagnoses; the verdict on a version that a person
/// put in force; the changes that clients requested under an id, with their outcomes; the rows
/// without text; the batches that no job uses any more; and the store's identity. For a shared
/// store: the server that works on a job, its start (`token`), the time until which it counts as
/// alive, and the person who wants the job to end. For each cell: the highest version number, in
/// the row that is locked where several servers write.
extern const char* const kTablesBeside;
/// Removes the tables in which servers with stores of their own recorded each other. Older programs
/// create them again in a file.
extern const char* const kTablesGone;
extern const char* const kAuditTables;
extern const char* const kAuditServer;  ///< an added column: the server that made the change
/// The column that was added to outcomes of jobs: why a person decides about the model (HeldBack).
extern const char* const kOutcomeHeldBack;
/// A column that was added to health checks: the requested tolerance, m.
extern const char* const kCheckTolerance;

/// The tables of a store that several servers share: the present servers, by their starts
/// (`token`), and the descriptions of cells. The record uses the newest description of a cell.
extern const char* const kTablesOfServers;

[[nodiscard]] std::string in_sqlite(std::string tables);
[[nodiscard]] std::string in_postgres(std::string tables);

}  // namespace trammel
