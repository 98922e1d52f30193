#include "server/compensate/model_spec.h"

#include <memory>

#include "server/bias/kernels/kernel_spelling.h"
#include "server/error_sources/error_source.h"
#include "server/error_sources/physical_model.h"
#include "server/robot/cell_row.h"

namespace trammel {
namespace {

Error in_cell_file(Error why, const char* key, const Cell& cell, const std::string& file) {
  why.field.clear();
  why.row = row_of_model_key(cell, key);
  return Failure(std::move(why))
      .as(ErrorCode::kRefused)
      .under(fmt::format("model: {}", key))
      .in(file)
      .value();
}

std::vector<Error> check_sources(const Cell& cell) {
  std::vector<Error> problems;
  for (const std::string& source : spelled_out(cell.model.error_sources, cell)) {
    const auto made = make_error_source(source, cell);
    if (!made) problems.push_back(made.error());
  }
  if (!problems.empty()) return problems;
  const auto together =
      make_physical_model(std::make_shared<const Cell>(cell), cell.model.error_sources);
  if (!together) problems.push_back(together.error());
  return problems;
}

}  // namespace

std::vector<Error> check_model_spec(const Cell& cell, const std::string& file, SpecUse use) {
  std::vector<Error> problems;
  if (use.bias) {
    if (const Status bias = check_bias_spelling(cell.model.bias); !bias)
      problems.push_back(in_cell_file(bias.error(), "bias", cell, file));
  }
  if (use.error_sources) {
    for (Error& why : check_sources(cell))
      problems.push_back(in_cell_file(std::move(why), "error_sources", cell, file));
  }
  return problems;
}

}  // namespace trammel
