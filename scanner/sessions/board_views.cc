#include "scanner/sessions/board_views.h"

#include <algorithm>
#include <utility>

#include "core/parallel.h"

namespace sateen {
namespace {

struct Looked {
  ImageSize size_px;  // 0 x 0 where the photograph cannot be read
  Result<BoardView> view = tl::unexpected<Error>({ErrorCode::kDegenerate, ""});
  std::map<std::string, std::string> sha256_of_input;
};

Looked LookAt(const BoardPhoto& photo, const BoardSpec& spec) {
  Looked looked;
  Result<BoardPicture> picture = ReadBoardPicture(photo);
  if (!picture) {
    looked.view = tl::unexpected(picture.error());
    return looked;
  }
  looked.size_px = picture->grey.Size();
  looked.sha256_of_input = std::move(picture->sha256_of_input);
  looked.view = FindBoard(picture->grey, spec);
  if (looked.view) {
    looked.view->name = photo.name;
  }
  return looked;
}

// Returns the size that most pictures have; the first of equally frequent ones.
ImageSize CommonSize(const std::vector<Looked>& all) {
  ImageSize common;
  std::ptrdiff_t most = 0;
  for (const Looked& looked : all) {
    const auto count = std::count_if(all.begin(), all.end(), [&](const Looked& other) {
      return other.size_px == looked.size_px;
    });
    if (looked.size_px.width > 0 && count > most) {
      most = count;
      common = looked.size_px;
    }
  }
  return common;
}

}  // namespace

Result<FoundBoards> FindBoards(const std::filesystem::path& path, const BoardSpec& spec,
                               const Task& task) {
  Result<BoardFolder> folder = ListBoardPhotos(path);
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  const size_t count = folder->photos.size();
  std::vector<Looked> all(count);
  task.BeginStage("finding the board", static_cast<int>(count));
  const Status ran = ParallelFor(static_cast<int>(count), 1, task, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      all[static_cast<size_t>(i)] = LookAt(folder->photos[static_cast<size_t>(i)], spec);
    }
  });
  if (!ran) {
    return tl::unexpected(ran.error());
  }
  FoundBoards found{.size_px = CommonSize(all), .ignored = std::move(folder->ignored)};
  found.sha256_of_input = std::move(folder->sha256_of_input);
  for (size_t i = 0; i < count; ++i) {
    Looked& looked = all[i];
    BoardPhoto& photo = folder->photos[i];
    found.sha256_of_input.merge(looked.sha256_of_input);
    if (looked.size_px.width > 0 && !(looked.size_px == found.size_px)) {
      found.rejected.push_back(
          {photo.name,
           fmt::format("is {} x {} px, and most are {} x {}; use one camera, one way up",
                       looked.size_px.width, looked.size_px.height, found.size_px.width,
                       found.size_px.height)});
    } else if (!looked.view) {
      found.rejected.push_back({photo.name, looked.view.error().message});
    } else {
      found.views.push_back(*std::move(looked.view));
      found.photos.push_back(std::move(photo));
    }
  }
  if (found.views.empty()) {
    return Fail(ErrorCode::kDegenerate, "{}: board '{}' is in none of {} photographs; {}: {}",
                path.string(), spec.Text(), count, found.rejected.front().name,
                found.rejected.front().reason);
  }
  return found;
}

}  // namespace sateen
