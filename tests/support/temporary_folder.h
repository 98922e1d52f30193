#pragma once

#include <filesystem>
#include <string>

namespace trammel::test {

/// A new empty folder, removed with its contents at the end.
class TemporaryFolder {
 public:
  /// kInMemory: where the host has room in a file system of its memory, for many files that need
  /// not outlive the test. On a disk each of them is discarded as it is removed, one by one.
  enum class Place { kDisk, kInMemory };
  explicit TemporaryFolder(Place place = Place::kDisk);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Path of `name` inside.
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }
  /// Writes `text` to `name` inside; returns its path.
  std::string write(const std::string& name, const std::string& text) const;

 private:
  std::filesystem::path path_;
};

/// The contents of the file.
[[nodiscard]] std::string read_file(const std::string& path);

}  // namespace trammel::test
