#include "tests/support/temporary_folder.h"

#include <stdlib.h>

#include <fstream>
#include <sstream>
#include <system_error>

#include "server/base/check.h"

namespace trammel::test {

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "trammel-XXXXXX").string();
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
