/PROG  WELD_SEAM	  Macro
/ATTR
OWNER		= MNEDITOR;
COMMENT		= "Seam; first try";
PROG_SIZE	= 1470;
CREATE		= DATE 21-07-09  TIME 07:32:14;
MODIFIED	= DATE 21-08-04  TIME 17:19:58;
FILE_NAME	= ;
VERSION		= 0;
LINE_COUNT	= 24;
MEMORY_SIZE	= 1895;
PROTECT		= READ_WRITE;
TCD:  STACK_SIZE	= 0,
      TASK_PRIORITY	= 50,
      TIME_SLICE	= 0,
      BUSY_LAMP_OFF	= 0,
      ABORT_REQUEST	= 0,
      PAUSE_REQUEST	= 0;
DEFAULT_GROUP	= 1,1,*,*,*;
CONTROL_CODE	= 00000000 00000000;
LOCAL_REGISTERS	= 0,0,0;
/APPL

AUTO_SINGULARITY_HEADER;
  ENABLE_SINGULARITY_AVOIDANCE   : TRUE;
/MN
   1:  !******************************** ;
   2:  ! Seam of the left door ;
   3:   ;
   4:  UFRAME_NUM=4 ;
   5:  UTOOL_NUM=2 ;
   6:  OVERRIDE=30% ;
   7:  R[24:Retry]=R[24:Retry]+1 ;
   8:  IF (DI[34:Dry cycle]=ON OR $SPOTCONFIG.$STROKE_ENBL=0 OR
    :  DO[470:Fault]=ON),JMP LBL[99] ;
   9:J P[1:home] 100% FINE    ;
  10:J PR[2:Pounce/Home 2] R[23:fast]% CNT R[25]    ;
  11:L P[3] 150mm/sec FINE Wjnt Offset,PR[90:z up]    ;
  12:L P[R[5]] 2.5sec CNT0 ACC50 PTH    ;
  13:C P[4]    
    :  P[5] 100mm/sec CNT100    ;
  14:L P[6] WELD_SPEED CNT100 TB   .10sec,P-SPOT    ;
      1:  DO[41]=ON ;
      2:  WAIT   .50(sec) ;
       ------ ;
  15:A P[6] 60cm/min CNT50    ;
  16:S P[6] 10.5mm/sec CNT100    ;
  17:L P[6] max_speed CD50    ;
  18:  SELECT R[55]=1,JMP LBL[10] ;
  19:         =2,JMP LBL[11] ;
  20:  //CALL WELD_OFF ;
  21:  WAIT   1.00(sec) ;
  22:  --eg:a remark that is longer than the line of the teach pendant, which
    :  breaks it ;
  23:  LBL[99:NOT COMPLETE] ;
  24:  END ;
/POS
P[1:"home"]{
   GP1:
	UF : 4, UT : 2,	
	J1=    15.145 deg,	J2=     -.000 deg,	J3=      .582 deg,
	J4=     -.593 deg,	J5=   -88.918 deg,	J6=     0.000 deg
   GP2:
	UF : 0, UT : 1,	
	J1=  1115.426  mm
};
P[3]{
   GP1:
	UF : 4, UT : 2,		CONFIG : 'N U T, 0, 0, 0',
	X =   157.231  mm,	Y = -2865.540  mm,	Z =  1171.327  mm,
	W =    90.000 deg,	P =   -43.084 deg,	R =   179.995 deg,
	E1= -4335.746  mm
};
P[4]{
   GP1:
	UF : F, UT : F,		KONFIG : 'F D B, 0, -1, 1',
	X =      .044  mm,	Y =    -4.101  mm,	Z =     0.000  mm,
	W =     -.242 deg,	P =     -.001 deg,	R =  -170.000 deg
};
P[5]{
   GP1:
	UF : 4, UT : 2,		CONFIG : 'N U T, 0, 0, 0',
	X =  ********  mm,	Y =  ********  mm,	Z =  ********  mm,
	W =  ******** deg,	P =  ******** deg,	R =  ******** deg
};
P[6]{
   GP1:
	UF : 4, UT : 2,		CONFIG : 'N U T, 0, 0, 0',
	X =    71.038  mm,	Y =  -501.000  mm,	Z =   217.734  mm,
	W =     -.437 deg,	P =     -.189 deg,	R =     -.846 deg
};
/END
