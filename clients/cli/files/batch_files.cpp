#include "clients/cli/files/batch_files.h"

#include <cstdio>
#include <map>

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

}  // namespace

Result<CheckedBatch> read_checked_batches(const std::vector<std::string>& paths, const Cell& cell,
                                          const HoldOut& hold_out) {
  std::vector<MeasurementBatch> read;
  for (const std::string& path : paths) {
    Result<MeasurementBatch> batch = read_batch(path);
    if (!batch) return tl::make_unexpected(batch.error());
    read.push_back(std::move(*batch));
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
               "{} measurements stand in several of these files, to the last digit: each counts once, in the first\n",
               copies);
  }
  return all;
}

}  // namespace trammel::cli
