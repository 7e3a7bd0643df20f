/* The program around the proof: entry and two system calls, no C library.
   x86-64 Linux: syscall numbers 1 (write) and 60 (exit), arguments in rdi, rsi, rdx. */
#if !defined(__x86_64__) || !defined(__linux__)
#error "this proof runs on x86-64 Linux only"
#endif

typedef __SIZE_TYPE__ size_t;

/* The four functions that Rust's core library asks of every platform. Those for microcontrollers
   ship them with the compiler; this one leaves them to libc, which is not here. Byte by byte in
   assembler, lest the compiler turn a loop into a call of the function it is in. */
void *memcpy(void *to, const void *from, size_t count)
{
    void *begin = to;
    __asm__ volatile("rep movsb" : "+D"(to), "+S"(from), "+c"(count) : : "memory");
    return begin;
}

void *memset(void *to, int byte, size_t count)
{
    void *begin = to;
    __asm__ volatile("rep stosb" : "+D"(to), "+c"(count) : "a"(byte) : "memory");
    return begin;
}

void *memmove(void *to, const void *from, size_t count)
{
    char *end = (char *)to + count;
    const char *from_end = (const char *)from + count;
    if ((size_t)to - (size_t)from >= count)
        return memcpy(to, from, count);
    while (end != to) {
        *--end = *--from_end;
        __asm__ volatile("" : : : "memory");
    }
    return to;
}

int memcmp(const void *left, const void *right, size_t count)
{
    const unsigned char *a = left, *b = right;
    for (; count > 0; a++, b++, count--)
        if (*a != *b)
            return *a - *b;
    return 0;
}

/* Null, or a sentence for what went wrong: see src/lib.rs. */
const char *onecycle_proof(void);

/* The kernel enters with the stack aligned to 16; a C function expects a call to have moved it. */
__asm__(".globl _start\n"
        "_start:\n"
        "    xor %ebp, %ebp\n"
        "    call onecycle_proof_main\n"
        "    ud2\n");

static long system_call(long number, long first, const void *second, long third)
{
    long result;
    __asm__ volatile("syscall"
                     : "=a"(result)
                     : "a"(number), "D"(first), "S"(second), "d"(third)
                     : "rcx", "r11", "memory");
    return result;
}

static void write_line(const char *line)
{
    long length = 0;
    while (line[length] != 0)
        length++;
    system_call(1, 1, line, length);
    system_call(1, 1, "\n", 1);
}

__attribute__((noreturn)) static void leave(long status)
{
    for (;;)
        system_call(60, status, 0, 0);
}

__attribute__((noreturn)) void onecycle_proof_panicked(void)
{
    write_line("panicked");
    leave(101);
}

__attribute__((noreturn, used)) void onecycle_proof_main(void)
{
    const char *wrong = onecycle_proof();
    write_line(wrong ? wrong : "ok");
    leave(wrong ? 1 : 0);
}
