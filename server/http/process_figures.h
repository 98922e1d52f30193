#pragma once

#include <cstdint>
#include <string>

namespace trammel {

/// The system's figures of this process, and of the disk with the store. A figure that the system
/// does not provide is 0.
struct ProcessFigures {
  double resident_bytes = 0;
  double processor_s = 0;
  double threads = 0;
  double open_files = 0;
  double started = 0;  ///< Unix time, s
};
[[nodiscard]] ProcessFigures process_figures();

struct StoreFileFigures {
  double bytes = 0;
  double journal_bytes = 0;  ///< of the write-ahead log
  double free_bytes = 0;     ///< of the disk, available to this process
};
[[nodiscard]] StoreFileFigures store_file_figures(const std::string& path);

}  // namespace trammel
