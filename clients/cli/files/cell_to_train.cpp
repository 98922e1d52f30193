#include "clients/cli/files/cell_to_train.h"

namespace trammel::cli {

Result<Cell> read_cell_to_train(const std::string& path, SpecUse use) {
  return read_cell(path).and_then([&](Cell cell) -> Result<Cell> {
    std::vector<Error> problems = check_model_spec(cell, path, use);
    if (!problems.empty()) return tl::make_unexpected(together(std::move(problems)));
    return cell;
  });
}

}  // namespace trammel::cli
