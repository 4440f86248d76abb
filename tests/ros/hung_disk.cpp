// A disk that does not answer: nothing is brought to it while the file `HANGS` is there.

#include <cstdlib>

#include <sys/syscall.h>
#include <unistd.h>

extern "C" int fsync(int file) {
    const char *hangs = std::getenv("HANGS");
    while (hangs != nullptr && access(hangs, F_OK) == 0) usleep(10000);
    return static_cast<int>(syscall(SYS_fsync, file));
}
