#include "clients/cli/files/batch_files.h"

#include <cstdio>
#include <map>

#include "clients/cli/files/near_columns.h"
#include "server/base/text_file.h"
#include "server/measurement/files/batch_file.h"

namespace trammel::cli {

namespace {

/// Files of one name in several folders get numbers: `batch`, `batch-2`.
void tell_apart(std::vector<MeasurementBatch>& batches) {
  std::map<std::string, int> met;
  for (MeasurementBatch& batch : batches) {
    const int count = ++met[batch.id];
    if (count > 1) batch.id += fmt::format("-{}", count);
  }
}

/// JSON, as a model is.
bool is_model(const std::string& text) { return text.starts_with("{\""); }

}  // namespace

Result<MeasurementBatch> read_batch_file(const std::string& path) {
  const std::string text = TRY(read_text_file(path));
  if (is_model(text)) return refused("this is a model file, not a batch").in(path);
  Result<MeasurementBatch> batch = parse_batch(text, path);
  if (batch) tell_columns_left_aside(*batch, text, path);
  return std::move(batch).map(
      [&](MeasurementBatch read) { return dated(std::move(read), written_at(path)); });
}

Result<JointList> read_joint_file(const std::string& path) {
  const std::string text = TRY(read_text_file(path));
  Result<JointList> list = parse_joint_csv(text, path);
  if (list) tell_near_columns(text, TableKind::kJoints, path);
  return list;
}

Result<CheckedBatch> read_checked_batches(const std::vector<std::string>& paths, const Cell& cell,
                                          const HoldOut& hold_out) {
  std::vector<MeasurementBatch> read;
  for (const std::string& path : paths) {
    MeasurementBatch batch = TRY(read_batch_file(path));
    read.push_back(std::move(batch));
  }
  tell_apart(read);
  std::vector<CheckedBatch> checked;
  for (MeasurementBatch& batch : read) {
    Result<CheckedBatch> one = check_against_cell(std::move(batch), cell, hold_out);
    if (!one) return one;
    checked.push_back(std::move(*one));
  }
  CheckedBatch all = joined(std::move(checked));
  if (const int copies = all.rows().copies; copies > 0) {
    fmt::print(stderr,
               "{} measurements stand in several of these files, to the last digit: each counts "
               "once, in the first\n",
               copies);
  }
  return all;
}

}  // namespace trammel::cli
