#include "server/report/pages_beside.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <vector>

#include "server/base/text_file.h"
#include "server/report/html.h"

namespace trammel {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kHead = 4096;     // bytes of a page that are read
constexpr int kMostEntries = 2000;      // of a folder
constexpr std::size_t kMostLinks = 40;  // of a page
constexpr std::string_view kPlace = "<nav class=\"beside\">", kPlaceEnd = "</nav>";
constexpr std::uintmax_t kLargest = 16'000'000;  // bytes of a page that is given links
constexpr std::string_view kMark = "<meta name=\"trammel-page\"";

/// The names of pages of each kind in links, in their order.
constexpr std::array<std::pair<std::string_view, std::string_view>, 9> kKinds = {
    {{"fleet", "fleet"},
     {"view", "cell in space"},
     {"history", "history"},
     {"model", "model"},
     {"diagnosis", "diagnosis"},
     {"health", "health"},
     {"remedies", "remedies"},
     {"comparison", "comparison"},
     {"program", "corrected program"}}};

/// A mark as a file has it: its texts are escaped.
struct FoundMark {
  std::size_t kind = 0;  // place in kKinds
  std::string cell, model, file;
};

std::string attribute(std::string_view tag, std::string_view name) {
  const std::string opening = fmt::format(" {}=\"", name);
  const std::size_t from = tag.find(opening);
  if (from == std::string_view::npos) return "";
  const std::string_view rest = tag.substr(from + opening.size());
  return std::string(rest.substr(0, rest.find('"')));
}

std::optional<FoundMark> mark_in(std::string_view page) {
  const std::size_t from = page.find(kMark);
  if (from == std::string_view::npos) return std::nullopt;
  const std::string_view tag = page.substr(from, page.find('>', from) - from);
  const std::string kind = attribute(tag, "content");
  const auto known = std::find_if(kKinds.begin(), kKinds.end(),
                                  [&](const auto& one) { return one.first == kind; });
  if (known == kKinds.end() || tag.find('<', 1) != std::string_view::npos) return std::nullopt;
  return FoundMark{static_cast<std::size_t>(known - kKinds.begin()), attribute(tag, "data-cell"),
                   attribute(tag, "data-model"), ""};
}

std::string beginning_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string text(kHead, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(0, in.gcount())));
  return text;
}

bool is_page(const fs::directory_entry& entry) {
  std::error_code error;
  return entry.path().extension() == ".html" && entry.is_regular_file(error) && !error;
}

std::vector<FoundMark> marks_in(const fs::path& folder, const std::string& but) {
  std::vector<FoundMark> marks;
  std::error_code error;
  int seen = 0;
  for (fs::directory_iterator at(folder, error), end; !error && at != end && seen < kMostEntries;
       at.increment(error)) {
    ++seen;
    if (!is_page(*at) || at->path().filename() == but) continue;
    if (auto mark = mark_in(beginning_of(at->path()))) {
      mark->file = at->path().filename().string();
      marks.push_back(std::move(*mark));
    }
  }
  return marks;
}

/// `./file` with percent encoding of bytes that a URL must not have, so that no file name is read
/// as a URL.
std::string address_of(const std::string& file) {
  std::string address = "./";
  for (const char c : file) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_' || c == '.' || c == '~';
    address += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return address;
}

std::string link_to(const FoundMark& mark, bool names_cell) {
  std::string what(kKinds[mark.kind].second);
  if (names_cell && !mark.cell.empty()) what += " of " + mark.cell;
  if (!mark.model.empty()) what += " " + mark.model;
  return fmt::format("<a href=\"{}\">{} ({})</a>", address_of(mark.file), what,
                     html_text(mark.file));
}

/// Of one cell, or one of them of several.
bool are_related(const FoundMark& one, const FoundMark& other) {
  return one.cell.empty() || other.cell.empty() || one.cell == other.cell;
}

}  // namespace

std::string page_mark(const PageMark& mark) {
  return fmt::format("{} content=\"{}\" data-cell=\"{}\" data-model=\"{}\">", kMark, mark.kind,
                     html_text(mark.cell), html_text(mark.model));
}

std::string with_pages_beside(std::string page, const std::string& path) {
  const std::size_t place = page.find(kPlace);
  const std::size_t end = place == std::string::npos ? place : page.find(kPlaceEnd, place);
  const auto own = mark_in(std::string_view(page).substr(0, kHead));
  if (path == "-" || end == std::string::npos || !own) return page;
  const fs::path folder = fs::path(path).parent_path();
  auto marks = marks_in(folder.empty() ? "." : folder, fs::path(path).filename().string());
  std::erase_if(marks, [&](const FoundMark& one) { return !are_related(one, *own); });
  std::sort(marks.begin(), marks.end(), [](const FoundMark& a, const FoundMark& b) {
    return std::tie(a.kind, a.cell, a.file) < std::tie(b.kind, b.cell, b.file);
  });
  if (marks.size() > kMostLinks) marks.resize(kMostLinks);
  std::string links;
  for (const FoundMark& one : marks) links += link_to(one, own->cell.empty()) + "\n";
  if (!links.empty()) links = "Beside this page: " + links;
  return page.replace(place + kPlace.size(), end - place - kPlace.size(), links);
}

void link_pages_beside(const std::string& page, const std::string& path) {
  const auto own = mark_in(std::string_view(page).substr(0, kHead));
  if (path == "-" || !own) return;
  const fs::path parent = fs::path(path).parent_path();
  const fs::path folder = parent.empty() ? "." : parent;
  for (const FoundMark& one : marks_in(folder, fs::path(path).filename().string())) {
    const std::string file = (folder / one.file).string();
    std::error_code error;
    const bool plain = !fs::is_symlink(file, error) && fs::file_size(file, error) <= kLargest;
    if (!are_related(one, *own) || error || !plain) continue;
    const auto text = read_text_file(file);
    if (!text) continue;
    const std::string linked = with_pages_beside(*text, file);
    // A page that must not be changed stays as it was: it lacks a link, and nothing else.
    if (linked != *text) static_cast<void>(write_text_file(file, linked));
  }
}

}  // namespace trammel
