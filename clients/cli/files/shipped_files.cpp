#include "clients/cli/files/shipped_files.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

namespace trammel::cli {

std::string shipped_file(const std::string& name) {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path installed = program.parent_path() / TRAMMEL_DATA_FROM_PROGRAM / name;
  if (!error && std::filesystem::exists(installed, error))
    return installed.lexically_normal().string();
  return TRAMMEL_SOURCE_DATA "/" + name;
}

std::vector<std::string> shipped_robots() {
  std::vector<std::string> paths;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(shipped_file("models"), error))
    if (entry.path().extension() == ".yaml") paths.push_back(entry.path().string());
  std::sort(paths.begin(), paths.end());
  return paths;
}

}  // namespace trammel::cli
