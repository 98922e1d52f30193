// A program that links libtrammel as others do: it learns from a batch, or extends a cell by its
// findings, and prints the result. `trammel_library_door train|extend CELL BATCH`; exit code 0
// done, 1 nothing applied, 3 refused.
#include <cstdio>
#include <string>
#include <vector>

#include "trammel/offline.h"

namespace {

namespace api = trammel::api;

int refused(const api::Error& error) {
  std::printf("%s\n", error.message.c_str());
  return error.code == api::ErrorCode::kRefused ? 3 : 2;
}

int train(const api::Cell& cell, const std::vector<api::Batch>& batches) {
  const auto model = api::train(cell, batches);
  if (!model) return refused(model.error());
  for (const api::Note& note : model->notes())
    std::printf("%s: %s\n", note.code.c_str(), note.text.c_str());
  return 0;
}

int extend(const api::Cell& cell, const std::vector<api::Batch>& batches) {
  const auto extension = api::extend(cell, batches);
  if (!extension) return refused(extension.error());
  std::printf("%s\n", extension->why_not.c_str());
  return extension->model ? 0 : 1;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 4) return 2;
  const auto cell = api::Cell::load(arguments[2]);
  if (!cell) return refused(cell.error());
  const auto batch = api::Batch::load(arguments[3]);
  if (!batch) return refused(batch.error());
  return std::string(arguments[1]) == "train" ? train(*cell, {*batch}) : extend(*cell, {*batch});
}
