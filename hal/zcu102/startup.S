/* Vectors and reset of the Cortex-R5. ARM state: the processor takes exceptions in it. */
    .syntax unified
    .arch armv7-r
    .arm

    .section .vectors, "ax"
    .global _vectors
_vectors:
    b   reset_handler
    b   undefined_handler
    b   supervisor_handler
    b   prefetch_handler
    b   data_handler
    nop
    b   interrupt_handler
    b   interrupt_handler

    .section .text.reset_handler, "ax"
    .global reset_handler
    .type reset_handler, %function  /* for the linker, which switches state on a call from Thumb code */
reset_handler:
    cpsid if, #0x13                 /* supervisor mode, no interrupts */
    mrc p15, 0, r0, c1, c0, 0       /* SCTLR */
    bic r0, r0, #(1 << 13)          /* V: vectors at 0 */
    bic r0, r0, #(1 << 30)          /* TE: exceptions in ARM state */
    orr r0, r0, #(1 << 19)          /* DZ: a division by zero is an undefined instruction, not a silent 0 */
    mcr p15, 0, r0, c1, c0, 0
    isb
    ldr sp, =_stack_top
    ldr r0, =start_program
    bx  r0

/* Each: cause (hal::ResetCause) in r0, the address of the culprit in r1, on a stack of its own. They do not return. */
    .section .text.fault_handlers, "ax"
undefined_handler:
    mov r0, #3
    mrs r2, spsr
    tst r2, #0x20                   /* Thumb? */
    subne r1, lr, #2
    subeq r1, lr, #4
    b   enter_fault
supervisor_handler:
    mov r0, #4
    sub r1, lr, #4
    b   enter_fault
prefetch_handler:
    mov r0, #5
    sub r1, lr, #4
    b   enter_fault
data_handler:
    mov r0, #6
    sub r1, lr, #8
    b   enter_fault
interrupt_handler:
    mov r0, #8
    sub r1, lr, #4
enter_fault:
    cpsid if, #0x13
    ldr sp, =_fault_stack_top
    ldr r2, =record_fault
    bx  r2
