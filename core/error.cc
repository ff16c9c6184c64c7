#include "core/error.h"

namespace sateen {

int ExitStatus(const Error& error) {
  switch (error.code) {
    case ErrorCode::kInvalidArgument:
      return 2;
    case ErrorCode::kBadData:
    case ErrorCode::kDegenerate:
      return 3;
    case ErrorCode::kIo:
      return 4;
    case ErrorCode::kDevice:
    case ErrorCode::kTimeout:
      return 5;
    case ErrorCode::kCancelled:
      return 6;
    case ErrorCode::kOutOfMemory:
      return 1;
  }
  return 1;
}

}  // namespace sateen
