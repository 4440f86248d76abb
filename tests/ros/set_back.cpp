// The time of day as a process sees it whose machine's clock was set back: 600 s less while the file `SET_BACK` is there.

#include <cerrno>
#include <cstdlib>
#include <ctime>

#include <sys/syscall.h>
#include <unistd.h>

extern "C" int clock_gettime(clockid_t clock, timespec *time) noexcept {
    const long failed = syscall(SYS_clock_gettime, clock, time);
    const int before = errno;
    const char *file = std::getenv("SET_BACK");
    if (failed == 0 && clock == CLOCK_REALTIME && file != nullptr && access(file, F_OK) == 0) time->tv_sec -= 600;
    errno = before;
    return static_cast<int>(failed);
}
