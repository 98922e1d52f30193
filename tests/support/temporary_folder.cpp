#include "tests/support/temporary_folder.h"

#include <stdlib.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>

#include "server/base/check.h"

namespace trammel::test {

namespace {

constexpr std::uintmax_t kRoom = std::uintmax_t{4} << 30;

std::filesystem::path folder_above(TemporaryFolder::Place place) {
  const std::filesystem::path memory = "/dev/shm";
  std::error_code none;
  const auto space = std::filesystem::space(memory, none);
  const bool fits = !none && space.available >= kRoom;
  return place == TemporaryFolder::Place::kInMemory && fits
             ? memory
             : std::filesystem::temp_directory_path();
}

}  // namespace

TemporaryFolder::TemporaryFolder(Place place) {
  std::string name = (folder_above(place) / "trammel-XXXXXX").string();
  TRAMMEL_CHECK(::mkdtemp(name.data()) != nullptr);
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string TemporaryFolder::write(const std::string& name, const std::string& text) const {
  const std::string path = file(name);
  std::ofstream stream(path, std::ios::binary);
  stream << text;
  stream.close();
  TRAMMEL_CHECK(stream.good());
  return path;
}

std::string read_file(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  TRAMMEL_CHECK(stream.good());
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

}  // namespace trammel::test
