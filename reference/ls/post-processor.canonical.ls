/PROG  surface
/ATTR
COMMENT		= "";
TCD:  STACK_SIZE	= 0,
      TASK_PRIORITY	= 50;
DEFAULT_GROUP	= 1,*,*,*,*;
/MN
   1:  UFRAME_NUM=0 ;
   2:   ;
   3:J P[1] 100% CNT60    ;
   4:L P[2] 200mm/sec CNT60    ;
   5:C P[1]    
    :  P[2] 0.5sec FINE    ;
/POS
P[1]{
   GP1:
	UF : 0, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =   925.450  mm,	Y = -106.4567  mm,	Z =   170.000  mm,
	W =  -175.630 deg,	P =     -.920 deg,	R =     2.890 deg
};
P[2:"second"]{
   GP1:
	UF : 0, UT : 1,	
	J1=      .500 deg,	J2=      .500 deg,	J3=     -.000 deg,
	J4=     -.500 deg,	J5=     1.000 deg,	J6=    -.0004 deg
};
/END
